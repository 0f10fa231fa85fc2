// A program that takes part in a comparison: Roberts' sequence, with a random shift in each pixel.
//
//     g++ -O2 points_example.cpp -o mine && qmcjax compare --program "./mine {width} {height} {spp} {dims} {seed}"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

static uint32_t hashed(uint32_t word) {
    word = (word ^ (word >> 16)) * 0x21f0aaadu;
    word = (word ^ (word >> 15)) * 0xd35a2d97u;
    return word ^ (word >> 15);
}

int main(int count, char **words) {
    if (count != 6) {
        std::fprintf(stderr, "usage: width height spp dims seed\n");
        return 1;
    }
    const uint32_t width = std::atoi(words[1]), height = std::atoi(words[2]), spp = std::atoi(words[3]);
    const uint32_t dims = std::atoi(words[4]), seed = std::atoi(words[5]);
    double root = 2;  // x^(dims + 1) = x + 1
    for (int step = 0; step < 64; step++) root = std::pow(1 + root, 1.0 / (dims + 1));
    std::vector<uint32_t> step(dims);
    for (uint32_t j = 0; j < dims; j++) step[j] = uint32_t(std::pow(root, -1.0 - j) * 4294967296.0);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint32_t s = 0; s < spp; s++)
                for (uint32_t j = 0; j < dims; j++) {
                    const uint32_t shift = hashed(hashed(hashed(hashed(seed) ^ y) ^ x) ^ j);
                    const float value = float((shift + s * step[j]) >> 8) / 16777216.0f;  // never 1
                    std::fwrite(&value, sizeof value, 1, stdout);
                }
}
