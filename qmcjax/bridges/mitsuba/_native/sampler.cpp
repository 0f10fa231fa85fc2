// A sampler of Mitsuba's scalar variants that calls compiled functions, without Python: one per thread.
//
// Compiled once for each variant, with -DSPECTRUM=its type of colours. Python describes the image in a Task.

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <mitsuba/core/plugin.h>
#include <mitsuba/core/properties.h>
#include <mitsuba/core/spectrum.h>
#include <mitsuba/render/sampler.h>

NAMESPACE_BEGIN(mitsuba)

/// The same members as in Python.
struct Task {
    void (*prepare)(uint32_t x, uint32_t y, const uint32_t *seeds, void *pixel);
    void (*sample)(const void *pixel, uint32_t number, const uint32_t *seeds, float *coordinates);
    void (*pair)(const void *pixel, uint32_t pair, uint32_t number, const uint32_t *seeds, float *both);
    const uint32_t *seeds;
    const uint32_t *corners; // Of each block: column and row of its first pixel in the window.
    uint32_t pixel_bytes, dims, blocks, side, width, height, left, top, first;
};

template <typename Float, typename Spectrum> class QmcjaxSampler final : public Sampler<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Sampler, m_sample_count)
    MI_IMPORT_TYPES()

    explicit QmcjaxSampler(const Properties &properties)
        : Base(properties), m_owner(properties.get<ref<Object>>("owner")),
          m_task((const Task *) (uintptr_t) properties.get<int64_t>("task")),
          m_pixel((m_task->pixel_bytes + 7) / 8), m_values(m_task->dims) {}

    ref<Sampler<Float, Spectrum>> fork() override { return new QmcjaxSampler(*this); }

    ref<Sampler<Float, Spectrum>> clone() override { return new QmcjaxSampler(*this); }

    void seed(UInt32 seed, uint32_t wavefront_size) override {
        Base::seed(seed, wavefront_size);
        const Task &task = *m_task;
        const uint32_t block = seed / (task.side * task.side), pixel = seed % (task.side * task.side);
        if (block >= task.blocks)
            throw std::runtime_error(
                "seed must be 0 in scalar variants, samples_per_pass unset, and block_size the integrator's, got "
                "pixel " + std::to_string(pixel) + " of block " + std::to_string(block) + " of " +
                std::to_string(task.blocks) + ": use first_sample instead");
        const uint32_t x = even_bits(pixel) + task.corners[2 * block],
                       y = even_bits(pixel >> 1) + task.corners[2 * block + 1];
        m_x = std::min(x, task.width - 1) + task.left;
        m_y = std::min(y, task.height - 1) + task.top;
        task.prepare(m_x, m_y, task.seeds, m_pixel.data());
        start(task.first);
    }

    void advance() override { start(m_number + 1); }

    Float next_1d(Mask) override { return next()[0]; }

    Point2f next_2d(Mask) override {
        const float *both = next();
        return { both[0], both[1] };
    }

    std::string to_string() const override { return "QmcjaxSampler[]"; }

    MI_DECLARE_CLASS(QmcjaxSampler)

private:
    void start(uint32_t number) {
        m_number = number;
        m_next = 0;
        m_known = false;
    }

    /// The next pair of coordinates: the sampler's, then others.
    const float *next() {
        const Task &task = *m_task;
        if (m_number - task.first >= m_sample_count)
            throw std::runtime_error("sample_count must be the number of samples taken, got " +
                                     std::to_string(m_sample_count));
        const uint32_t pair = m_next++;
        if (2 * pair + 1 >= task.dims) {
            task.pair(m_pixel.data(), pair, m_number, task.seeds, m_both);
            return m_both;
        }
        if (!m_known) {
            task.sample(m_pixel.data(), m_number, task.seeds, m_values.data());
            check();
            m_known = true;
        }
        return m_values.data() + 2 * pair;
    }

    void check() const {
        for (float value : m_values)
            if (!(value >= 0.f && value < 1.f))
                throw std::runtime_error("sampler must return points in [0, 1), got " +
                                         std::to_string(value) + " in pixel (" + std::to_string(m_x) + ", " +
                                         std::to_string(m_y) + "), sample " + std::to_string(m_number));
    }

    /// Move bit 2 k to bit k.
    static uint32_t even_bits(uint32_t word) {
        word &= 0x55555555u;
        word = (word | word >> 1) & 0x33333333u;
        word = (word | word >> 2) & 0x0f0f0f0fu;
        word = (word | word >> 4) & 0x00ff00ffu;
        return (word | word >> 8) & 0x0000ffffu;
    }

    ref<Object> m_owner; // Of the task.
    const Task *m_task;
    std::vector<uint64_t> m_pixel;
    std::vector<float> m_values;
    float m_both[2];
    uint32_t m_x = 0, m_y = 0, m_number = 0, m_next = 0;
    bool m_known = false;
};

NAMESPACE_END(mitsuba)

using Made = mitsuba::QmcjaxSampler<float, SPECTRUM>;

/// Register the plugin under a name.
extern "C" MI_EXPORT void qmcjax_register(const char *name) {
    mitsuba::PluginManager::instance()->register_plugin(
        name, Made::Variant, Made::Type,
        [](void *, const mitsuba::Properties &properties) -> mitsuba::ref<mitsuba::Object> {
            return new Made(properties);
        },
        nullptr, nullptr);
}
