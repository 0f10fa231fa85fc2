// The image of the benchmark as a C++ programmer would write it: pixels along the Hilbert curve take contiguous
// blocks of the Owen-scrambled Sobol' (0,2)-sequence. Prints the seconds of a second call.
// usage: render scene side spp key image.raw
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

static uint32_t hilbert(uint32_t side, uint32_t x, uint32_t y) {
    uint32_t position = 0;
    for (uint32_t s = side / 2; s > 0; s /= 2) {
        const uint32_t right = (x & s) > 0, lower = (y & s) > 0;
        position += s * s * ((3 * right) ^ lower);
        if (lower == 0) {
            if (right == 1) { x = side - 1 - x; y = side - 1 - y; }
            const uint32_t t = x; x = y; y = t;
        }
    }
    return position;
}

static inline uint32_t reverse(uint32_t v) {
    v = __builtin_bswap32(v);
    v = (v & 0x0f0f0f0f) << 4 | ((v >> 4) & 0x0f0f0f0f);
    v = (v & 0x33333333) << 2 | ((v >> 2) & 0x33333333);
    return (v & 0x55555555) << 1 | ((v >> 1) & 0x55555555);
}

static inline uint32_t rotated(uint32_t v, int count) { return v << count | v >> (32 - count); }

static inline uint32_t masked_sum(uint32_t n, uint32_t summand, uint32_t mask) {
    return n ^ ((n ^ (n + (summand | 1))) & mask);
}

static inline uint32_t owen(uint32_t n, uint32_t seed) {  // of bit-reversed n, as qmcjax.core.bits.owen_hash
    n = ((n ^ rotated(seed, 1)) + rotated(seed, 5)) * (rotated(seed, 17) | 1);
    n = masked_sum(n, rotated(seed, 21), rotated(seed, 24));
    n = masked_sum(n, rotated(seed, 12), rotated(seed, 8));
    n ^= n * (rotated(seed, 29) & ~1u);
    return masked_sum(n * (rotated(seed, 1) | 1), rotated(seed, 4), rotated(seed, 17));
}

static inline uint32_t pascal(uint32_t v) {  // of bit-reversed v: the second component, in fixed point
    v ^= (v & 0x0000ffff) << 16; v ^= (v & 0x00ff00ff) << 8; v ^= (v & 0x0f0f0f0f) << 4;
    v ^= (v & 0x33333333) << 2;
    return v ^ (v & 0x55555555) << 1;
}

static inline float checkerboard(float x, float y) {
    const float z = 8.0f / y, u = (x - 0.5f) * z;
    const float half = 0.5f * (std::floor(u) + std::floor(z));
    return z < 4194304.0f ? 1.0f - 2.0f * (half - std::floor(half)) : 0.5f;
}

static inline float zone_plate(float x, float y) { return 0.5f + 0.5f * std::sin(1600.0f * (x * x + y * y)); }

template <float (*scene)(float, float)>
static void render(float* image, int side, uint32_t spp, uint32_t key) {
    const float scale = 1.0f / side;
    const uint32_t a = key * 0x9e3779b9u + 0x7f4a7c15u, b = a * 0x85ebca6bu ^ (a >> 13);
#pragma omp parallel for schedule(dynamic, 8)
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const uint32_t first = hilbert(side, x, y) * spp;
            float sum = 0.0f;
#pragma omp simd reduction(+ : sum)
            for (uint32_t s = 0; s < spp; ++s) {
                const uint32_t index = first + s;
                const uint32_t u = reverse(owen(index, a)), v = reverse(owen(reverse(pascal(reverse(index))), b));
                sum += scene((x + (u >> 8) * 0x1p-24f) * scale, (y + (v >> 8) * 0x1p-24f) * scale);
            }
            image[y * side + x] = sum / spp;
        }
}

int main(int, char** argument) {
    const auto render_scene = std::strcmp(argument[1], "checkerboard") == 0 ? render<checkerboard> : render<zone_plate>;
    const int side = std::atoi(argument[2]), spp = std::atoi(argument[3]), key = std::atoi(argument[4]);
    std::vector<float> image(side * side);
    for (int call = 0; call < 2; ++call) {
        const auto start = std::chrono::steady_clock::now();
        render_scene(image.data(), side, spp, key);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        if (call == 1) std::printf("%.9f\n", seconds.count());
    }
    std::FILE* file = std::fopen(argument[5], "wb");
    return std::fwrite(image.data(), sizeof(float), image.size(), file) != image.size() || std::fclose(file);
}
