// Parts that the JSON of all results share.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "files/recording.hpp"
#include "measurement/soc_column.hpp"

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

/// The judgement of a log's own SOC column; null without one.
inline Json soc_column_of(const std::optional<measurement::SocColumn>& column) {
  if (!column) return nullptr;
  Json events = Json::array();
  for (const measurement::SocEvent& e : column->events)
    events.push_back({{"time_s", e.time_s}, {"kind", measurement::name_of(e.fault)}, {"size", e.size}});
  return {{"is_count", column->is_count}, {"resolution", column->resolution}, {"events", events}};
}

inline std::string text_of(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace bms::reports
