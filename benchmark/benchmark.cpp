// The concealed benchmark: every case of a split through the diagnosis, the score, and what each case came to.
//
//   benchmark development|final SEED [FIRST [COUNT]]
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "benchmark/run_case.hpp"
#include "benchmark/score.hpp"

namespace {

std::string joined(const std::vector<std::string>& ids, const char* by) {
  std::string text;
  for (const std::string& id : ids) text += (text.empty() ? "" : by) + id;
  return text;
}

std::string share(const bms::benchmark::Share& s) { return fmt::format("{:5.1f} % ({} of {})", 100 * s.value(), s.hits, s.of); }

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: benchmark development|final SEED [FIRST [COUNT]]\n");
    return 2;
  }
  const truth::Split split = std::string(argv[1]) == "final" ? truth::Split::final : truth::Split::development;
  const auto seed = static_cast<std::uint64_t>(std::strtoull(argv[2], nullptr, 10));
  const std::size_t first = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 0;
  const std::size_t count = argc > 4 ? std::strtoul(argv[4], nullptr, 10) : truth::case_count(split) - first;
  std::vector<bms::benchmark::Outcome> outcomes(count);
  std::atomic<std::size_t> next = 0;
  std::mutex printing;
  const auto work = [&] {
    for (std::size_t k = next++; k < count; k = next++) {
      outcomes[k] = bms::benchmark::run_case(truth::make_case(split, seed, first + k));
      const auto& o = outcomes[k];
      std::string found;
      for (const auto& set : o.sets) found += (found.empty() ? "" : " + ") + joined(set, "~");
      const std::scoped_lock lock(printing);
      fmt::print("{:3} {:10} {:40} x{:<5.1f} {:16} -> {:13} {:50} iou {:.2f} hold {:.1f}->{:.1f} ({:.1f}) mV {:.1f} s  {}\n", first + k, o.answer.kind, joined(o.answer.ids, "+"), o.answer.strength,
                 o.answer.profile, bms::diagnosis::name_of(o.verdict), found, o.overlap, 1e3 * o.holdout_before_v, 1e3 * o.holdout_after_v, 1e3 * o.holdout_floor_v, o.wall_s, o.figures);
      if (o.next) {
        std::string after;
        for (const auto& set : o.next->sets) after += (after.empty() ? "" : " + ") + joined(set, "~");
        fmt::print("{:3} {:10} {:40} next: {} ({:.1f} h, gain {:.0f}, planned in {:.1f} s) -> {}{}\n", first + k, "", joined(o.answer.ids, "+"), o.next->profile.empty() ? "none" : o.next->profile, o.next->duration_s / 3'600,
                   o.next->expected_gain, o.next->plan_wall_s, after, o.next->separated ? "" : "  NOT SEPARATED");
      }
      std::fflush(stdout);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < std::max(1U, std::thread::hardware_concurrency()); ++k) threads.emplace_back(work);
  for (std::thread& t : threads) t.join();
  const auto s = bms::benchmark::score(outcomes);
  fmt::print("false alarms on nulls        {}\ndetected at twice the limit  {}\n  at any strength            {}\nright first                  {}\nright class first            {}\ntruth in the set             {}\nmean set size                {:.2f}\n"
             "pairs: both                  {}\npairs: one and none wrong    {}\noutside: unknown             {}\ndata faults                  {}\nhold-out                     {}\nseparated by the next one    {}\noverlap, median              {:.2f}\ncalibration error            {:.3f}\nseconds a case               {:.1f}\n",
             share(s.false_alarms), share(s.detected), share(s.detected_all), share(s.first), share(s.first_class), share(s.in_set), s.mean_set_size, share(s.pair_both), share(s.pair_one_none_wrong), share(s.outside_unknown),
             share(s.data_fault), share(s.holdout), share(s.separated), s.median_overlap, s.calibration_error, s.mean_wall_s);
}
