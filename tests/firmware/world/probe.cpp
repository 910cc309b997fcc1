#include <chrono>
#include <fmt/format.h>
#include "tests/firmware/world/scenarios.hpp"
using namespace bms::world;
int main(int n, char** w) {
  const Pack pack = pack_of(6);
  fmt::print("{}\n", pack.image.string());
  WorldSetup setup = typical_setup(pack);
  TruckWorld world(pack.image, setup);
  const double s = n > 1 ? std::stod(w[1]) : 5;
  world.vehicle.request = Request::drive;
  auto t0 = std::chrono::steady_clock::now();
  std::uint64_t i0 = 0;
  std::size_t events = 0;
  std::uint64_t faults = 0; unsigned state = 99;
  for (double t = 0; t < s * 1000; t += 5) {
    world.run_ms(5);
    for (; events < world.truck.events().size(); ++events) {
      auto& e = world.truck.events()[events];
      fmt::print("{:8.4f} relay {} {} across {:.2f} peak {:.1f} link {:.2f}\n", e.time_s, (int)e.relay, e.closes ? "closes" : "opens", e.across_v, e.peak_a, e.dc_link_v);
    }
    if (world.vehicle.faults() != faults || world.vehicle.state() != state) {
      faults = world.vehicle.faults(); state = world.vehicle.state();
      fmt::print("{:8.1f} ms state {} faults {} first {} ddsg {} dchg {} link {:.2f} pins {} {} {} {}\n", world.now_ms(), state, fault_names(faults), world.vehicle.first_cause(), world.chip.ddsg(), world.chip.dchg(), world.truck.voltages().dc_link_v(), (int)world.pin(bms::plant::Relay::main_plus), (int)world.pin(bms::plant::Relay::main_minus), (int)world.pin(bms::plant::Relay::precharge), (int)world.pin(bms::plant::Relay::charge));
    }
    if (t == 2000 || t == 2500) {
      double dt = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
      fmt::print("t {} real {:.2f} instr {}M resets {} adc {}\n", t, dt, (world.board.instructions - i0) / 1000000, world.board.resets.size(), world.adc.conversions);
    }
  }
  double dt = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
  fmt::print("{:.1f} s in {:.2f} s: {:.2f} x, {} M instructions, {} circuit steps, adc {} soc {}\n", s, dt, s / dt, world.board.instructions / 1000000, world.truck.circuit().steps(), world.adc.conversions, world.vehicle.soc_percent());
  for (auto& v : world.violations()) fmt::print("violation {}\n", v);
}
