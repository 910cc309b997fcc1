#include "hal/frame_dispatch.hpp"

#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"

namespace bms::hal {

namespace {

RequestQueue requests;

}  // namespace

bool dispatch_frame(const can::Frame& frame) {
  if (is_sample_frame(frame)) return true;
  requests.push(frame);
  return false;
}

bool next_request(can::Frame& frame) { return requests.pop(frame); }
bool next_network_frame(can::Frame& frame) { return requests.pop_network(frame); }

}  // namespace bms::hal
