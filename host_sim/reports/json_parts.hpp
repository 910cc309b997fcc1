// Parts that the JSON of all results share.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "files/recording.hpp"

namespace bms::reports {

using Json = nlohmann::ordered_json;

inline Json optional(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

/// JSON has no infinity and no NaN; they become null.
inline Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

inline Json warnings_of(const std::vector<measurement::Warning>& warnings) {
  Json list = Json::array();
  for (const measurement::Warning& w : warnings) list.push_back(w.id + ": " + w.text);
  return list;
}

/// How a file was read; of the project's own format the name of the format.
inline Json read_as(const std::string& text) { return text.empty() ? Json("recording") : Json(text); }

inline std::string text_of(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace bms::reports
