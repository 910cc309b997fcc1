/* The estimator in C: prints the state of charge during a minute of discharge at 6 A. */
#include <greybox/greybox.h>
#include <stdio.h>

static greybox_memory memory;

int main(void) {
  greybox_estimator* estimator;
  greybox_status status = greybox_create(&memory, sizeof memory, NULL, &estimator);
  if (status != GREYBOX_OK) {
    fprintf(stderr, "%s\n", greybox_status_text(status));
    return 1;
  }
  for (int second = 0; second <= 60; ++second) {
    greybox_sample sample = {(uint64_t)second * 1000000, second == 0 ? 0 : -6000000, second == 0 ? 3330000 : 3250000,
                             2500};
    greybox_estimate estimate;
    greybox_step(estimator, &sample, &estimate);
    if (second % 20 == 0) printf("%2d s: %.4f +- %.4f\n", second, (double)estimate.soc, (double)estimate.soc_sigma);
  }
  return 0;
}
