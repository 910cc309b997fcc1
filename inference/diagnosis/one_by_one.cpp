#include "diagnosis/one_by_one.hpp"

#include <optional>
#include <utility>

#include <fmt/format.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/mechanism.hpp"

namespace bms::diagnosis {

std::vector<MechanismSetting> settings_in(const std::vector<PreparedRecording>& records, std::size_t record,
                                          std::vector<MechanismSetting> settings) {
  for (MechanismSetting& s : settings) {
    if (record > 0 && s.index == model::mechanism_index_of<model::ContactStep>)
      s.value[contact_onset] = records[record].time_s.front();
  }
  return settings;
}

void set_views(Diagnosis& d, const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
               const std::vector<PreparedRecording>& records) {
  d.views.clear();
  for (std::size_t n = 0; n < records.size(); ++n) {
    RecordingView& view = d.views.emplace_back();
    view.base_v = predict(cell, own, records[n]);
    view.extended_v = predict(d.cell, settings_in(records, n, d.extended.settings), records[n], &view.soc);
  }
}

Diagnosis likeliest_alone(Diagnosis together, const model::CellParameters<>& cell,
                          const std::vector<MechanismSetting>& own, const std::vector<PreparedRecording>& records,
                          const std::function<Diagnosis(const PreparedRecording&)>& diagnose_one) {
  std::optional<Diagnosis> likeliest;
  std::size_t of = 0;
  for (std::size_t n = 0; n < records.size(); ++n) {
    Diagnosis one = diagnose_one(records[n]);
    if (one.interrupted) {
      together.interrupted = true;
      together.verdict = Verdict::unfinished;
      together.tried = std::move(one.tried);
      together.not_tried = std::move(one.not_tried);
      return together;
    }
    const double gain = one.base_cost - one.best_cost;
    if (!names(one.verdict) || !one.healthy || !one.healthy->decided) continue;  // else of no known false alarm rate
    if (likeliest && gain <= likeliest->base_cost - likeliest->best_cost) continue;
    likeliest = std::move(one);
    of = n;
  }
  if (!likeliest) return together;
  Diagnosis& d = *likeliest;
  d.extended.bursts.clear();  // they belong to one recording
  const auto not_in_the_first = [&](MechanismSetting& s) {
    if (of > 0 && s.index == model::mechanism_index_of<model::ContactStep>)
      s.value[contact_onset] = records.front().time_s.back() + 1;
  };
  for (MechanismSetting& s : d.extended.settings) not_in_the_first(s);
  set_views(d, cell, own, records);
  d.warnings = std::move(together.warnings);
  d.warnings.push_back(fmt::format("the recordings together are not explained: the answer is that of {} alone",
                                   records[of].name.empty() ? "one of them" : records[of].name));
  return std::move(*likeliest);
}

}  // namespace bms::diagnosis
