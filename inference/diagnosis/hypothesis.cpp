#include "diagnosis/hypothesis.hpp"

#include <algorithm>

namespace bms::diagnosis {

using model::catalogue;

std::vector<std::size_t> Hypothesis::added() const {
  std::vector<std::size_t> ids;
  for (std::size_t k = own; k < settings.size(); ++k) ids.push_back(settings[k].index);
  std::sort(ids.begin(), ids.end());
  return ids;
}

const MechanismSetting* Hypothesis::find(std::size_t mechanism) const {
  for (const MechanismSetting& s : settings) {
    if (s.index == mechanism) return &s;
  }
  return nullptr;
}

const MechanismSetting* Hypothesis::find(Signature signature) const {
  for (const MechanismSetting& s : settings) {
    if (knowledge_of(s.index).signature == signature) return &s;
  }
  return nullptr;
}

std::vector<ParameterRef> Hypothesis::sought() const {
  std::vector<ParameterRef> all;
  for (std::size_t k = own; k < settings.size(); ++k) {
    const model::MechanismInfo& info = catalogue[settings[k].index];
    for (std::size_t p = 0; p < info.parameters; ++p) {
      if (info.parameter[p].role != model::Role::given) all.push_back({k, p});
    }
  }
  return all;
}

std::string Hypothesis::name() const {
  std::string text;
  for (const std::size_t id : added()) text += (text.empty() ? "" : "+") + std::string(catalogue[id].id);
  return text.empty() ? "calibration" : text;
}

Hypothesis with(const Hypothesis& h, const MechanismSetting& setting) {
  Hypothesis more = h;
  more.settings.push_back(setting);
  return more;
}

Hypothesis with(const Hypothesis& h, std::size_t mechanism, const model::CellParameters<>& cell) {
  return with(h, model::default_setting(mechanism, cell));
}

Hypothesis without(const Hypothesis& h, std::size_t mechanism) {
  Hypothesis less = h;
  std::erase_if(less.settings, [&](const MechanismSetting& s) {
    return s.index == mechanism && &s - less.settings.data() >= static_cast<std::ptrdiff_t>(h.own);
  });
  return less;
}

}  // namespace bms::diagnosis
