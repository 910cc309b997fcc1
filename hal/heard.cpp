#include "hal/heard.hpp"

#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"

namespace bms::hal {

namespace {

std::optional<measurement::StartingPoint> start;
RequestQueue requests;

}  // namespace

bool hear(const can::Frame& frame) {
  if (is_start(frame)) start = start_of(frame);
  if (of_sample(frame)) return true;
  requests.keep(frame);
  return false;
}

bool next_request(can::Frame& frame) { return requests.next(frame); }

std::optional<measurement::StartingPoint> starting_point() { return start; }

}  // namespace bms::hal
