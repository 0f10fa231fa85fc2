// Mitsuba's headers need a function of this name for log messages, of which the plugin writes none.

#pragma once

#include <string>

namespace tinyformat {
template <typename... Arguments> std::string format(const char *text, const Arguments &...) { return text; }
} // namespace tinyformat

namespace tfm = tinyformat;
