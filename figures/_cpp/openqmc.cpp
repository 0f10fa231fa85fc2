// Points of OpenQMC's samplers: all samples of the pixels of an image, row by row, each of four dimensions.

#include <oqmc/lattice.h>
#include <oqmc/latticebn.h>
#include <oqmc/pmj.h>
#include <oqmc/pmjbn.h>
#include <oqmc/sobol.h>
#include <oqmc/sobolbn.h>

#include <vector>

// The samples of a row; the next row overwrites them.
template <typename Sampler>
__attribute__((noinline)) static void row(int y, int width, int spp, const void *cache, float *points) {
    for (int x = 0; x < width; x++) {
        for (int s = 0; s < spp; s++, points += 4) {
            Sampler(x, y, 0, s, cache).template drawSample<4>(points);
        }
    }
}

template <typename Sampler>
static void image(int width, int height, int spp, float *points) {
    static const std::vector<char> cache = [] {
        std::vector<char> made(Sampler::cacheSize);
        Sampler::initialiseCache(made.data());
        return made;
    }();
    for (int y = 0; y < height; y++) {
        row<Sampler>(y, width, spp, cache.data(), points);
        asm volatile("" : : : "memory");
    }
}

// All samples of a frame, in any even number of dimensions: each four are a domain of their own.
template <typename Sampler>
static void frame(int width, int height, int spp, int dims, int number, float *points) {
    std::vector<char> cache(Sampler::cacheSize);
    Sampler::initialiseCache(cache.data());
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int s = 0; s < spp; s++) {
                const Sampler pixel(x, y, number, s, cache.data());
                for (int first = 0; first < dims; first += 4) {
                    float drawn[4];
                    pixel.newDomain(first / 4).template drawSample<4>(drawn);
                    for (int j = first; j < dims && j < first + 4; j++) *points++ = drawn[j - first];
                }
            }
        }
    }
}

#define SAMPLER(name, Sampler)                                                                                    \
    extern "C" void name(int width, int height, int spp, float *points) { image<Sampler>(width, height, spp, points); } \
    extern "C" void name##_suite(int width, int height, int spp, int dims, int number, float *points) {           \
        frame<Sampler>(width, height, spp, dims, number, points);                                                 \
    }

SAMPLER(sobol, oqmc::SobolSampler)
SAMPLER(sobolbn, oqmc::SobolBnSampler)
SAMPLER(pmj, oqmc::PmjSampler)
SAMPLER(pmjbn, oqmc::PmjBnSampler)
SAMPLER(lattice, oqmc::LatticeSampler)
SAMPLER(latticebn, oqmc::LatticeBnSampler)
