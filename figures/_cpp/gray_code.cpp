// 2^m points of the Sobol' sequence, as printed in the thesis, Sect. 5.2.1: by Gray codes, and each by its
// index, which that program starts with. Prints the seconds, and the sum of the last component, of both in turns.
// usage: gray_code m turns dims < columns    (of dims matrices, all first columns first)
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

static std::vector<uint32_t> matrices, state;

static uint32_t by_gray_codes(uint64_t count, uint32_t dims) {
    uint32_t sum = 0;
    for (uint32_t &word : state) word = 0;
    for (uint64_t index = 1; index <= count; index++) {
        sum += state[dims - 1];
        const uint32_t *column = &matrices[__builtin_ctzll(index) % 32 * dims];
        for (uint32_t d = 0; d < dims; d++) state[d] ^= column[d];
    }
    return sum;
}

static uint32_t by_index(uint64_t count, uint32_t dims) {
    uint32_t sum = 0;
    for (uint64_t index = 0; index < count; index++) {
        for (uint32_t &word : state) word = 0;
        const uint32_t *column = matrices.data();
        for (uint32_t digits = index ^ index >> 1; digits; digits >>= 1, column += dims)
            if (digits & 1)
                for (uint32_t d = 0; d < dims; d++) state[d] ^= column[d];
        sum += state[dims - 1];
    }
    return sum;
}

int main(int, char **words) {
    const uint64_t count = 1ull << std::atoi(words[1]);
    const uint32_t dims = std::atoi(words[3]);
    matrices.resize(32 * dims);
    state.resize(dims);
    if (std::fread(matrices.data(), 4, matrices.size(), stdin) != matrices.size()) return 1;
    for (int turn = 0; turn < std::atoi(words[2]); turn++)
        for (auto make : {by_gray_codes, by_index}) {
            const auto start = std::chrono::steady_clock::now();
            const uint32_t sum = make(count, dims);
            const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
            std::printf("%.9f %u\n", taken.count(), sum);
        }
}
