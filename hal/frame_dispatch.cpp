#include "hal/frame_dispatch.hpp"

#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"

namespace bms::hal {

namespace {

std::optional<measurement::StartingPoint> start;
RequestQueue requests;

}  // namespace

bool dispatch_frame(const can::Frame& frame) {
  if (is_starting_point(frame)) start = starting_point_of(frame);
  if (is_sample_frame(frame)) return true;
  requests.push(frame);
  return false;
}

bool next_request(can::Frame& frame) { return requests.pop(frame); }

std::optional<measurement::StartingPoint> starting_point() { return start; }

}  // namespace bms::hal
