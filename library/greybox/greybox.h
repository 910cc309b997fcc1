/* The estimator of greybox-bms for C: state of charge of one cell and its standard deviation.
 *
 *   static greybox_memory memory;
 *   greybox_estimator *estimator;
 *   if (greybox_create(&memory, sizeof memory, NULL, &estimator) != GREYBOX_OK) ...
 *   greybox_step(estimator, &sample, &estimate);                          once for each sample
 *
 * The cell is chosen when the library is compiled: greybox/c_interface.hpp. Nothing here allocates, blocks or reads a
 * clock. Estimators are independent of each other; one estimator must not be used by two threads at a time.
 */
#ifndef GREYBOX_GREYBOX_H
#define GREYBOX_GREYBOX_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A reading that is missing. */
#define GREYBOX_NO_READING INT32_MIN
#define GREYBOX_NO_TEMPERATURE INT16_MIN

/* Bytes of greybox_memory. greybox_size() returns what the compiled cell needs. */
#ifndef GREYBOX_MEMORY_BYTES
#define GREYBOX_MEMORY_BYTES 2048
#endif

/* The caller's memory for one estimator, with the alignment that it needs. */
typedef union greybox_memory {
  uint64_t alignment;
  unsigned char bytes[GREYBOX_MEMORY_BYTES];
} greybox_memory;

typedef struct greybox_estimator greybox_estimator;

typedef enum greybox_status {
  GREYBOX_OK = 0,
  GREYBOX_BAD_ARGUMENT = 1,     /* a pointer is NULL */
  GREYBOX_MEMORY_TOO_SMALL = 2, /* less than greybox_size() */
  GREYBOX_MEMORY_MISALIGNED = 3,
  GREYBOX_NOT_CREATED = 4 /* the memory holds no estimator, or was overwritten */
} greybox_status;

/* All measurements of a cell at one time. Any reading may be missing or wrong: the estimator checks them. */
typedef struct greybox_sample {
  uint64_t time_us;          /* [us] since start-up; must increase */
  int32_t current_ua;        /* [uA] mean since the previous sample, > 0 charges */
  int32_t voltage_uv;        /* [uV] at time_us */
  int16_t temperature_cdegc; /* [0.01 degrees C] */
} greybox_sample;

/* State of charge before the first sample, from your storage or a user. */
typedef struct greybox_start {
  int32_t soc_ppb;       /* [1e-9] 0 to 1e9; a value outside is clamped */
  int32_t soc_sigma_ppb; /* [1e-9] its standard deviation, 1e3 to 1e9; a value outside is clamped */
} greybox_start;

/* Why an estimate is less accurate than usual; several reasons are or-ed. greybox_flag_text() has them in words. */
enum {
  GREYBOX_VOLTAGE_MISSING = 1 << 0,
  GREYBOX_VOLTAGE_IMPLAUSIBLE = 1 << 1,
  GREYBOX_VOLTAGE_STUCK = 1 << 2,
  GREYBOX_CURRENT_MISSING = 1 << 3,
  GREYBOX_CURRENT_IMPLAUSIBLE = 1 << 4,
  GREYBOX_TIME_GAP = 1 << 5,
  GREYBOX_TIME_NOT_INCREASING = 1 << 6,
  GREYBOX_CURRENT_BEYOND_LIMITS = 1 << 7,
  GREYBOX_NOT_STARTED = 1 << 8,
  GREYBOX_SOC_AMBIGUOUS = 1 << 9,
  GREYBOX_VOLTAGE_REJECTED = 1 << 10,
  GREYBOX_NOT_A_NUMBER = 1 << 11,
  GREYBOX_SOC_CONTRADICTED = 1 << 12
};

typedef struct greybox_estimate {
  float soc;                 /* state of charge, 0 empty to 1 full; -0.25 to 1.25 while it is being corrected */
  float soc_sigma;           /* its standard deviation */
  float v_rc_v;              /* [V] voltage over the RC branch */
  float voltage_predicted_v; /* [V] voltage that the model expected for this sample */
  uint32_t flags;            /* GREYBOX_VOLTAGE_MISSING and the others; 0: nothing unusual */
} greybox_estimate;

/* Bytes that an estimator of the compiled cell needs. */
size_t greybox_size(void);

/* Creates an estimator in `memory`, which must stay valid and must not be moved while it is used. start: NULL to
 * estimate the state of charge from the first voltage. Writes the estimator to *estimator; on an error NULL. */
greybox_status greybox_create(void* memory, size_t bytes, const greybox_start* start, greybox_estimator** estimator);

/* Processes one sample. Writes the estimate after it; estimate may be NULL. */
greybox_status greybox_step(greybox_estimator* estimator, const greybox_sample* sample, greybox_estimate* estimate);

/* Writes the estimate after the last sample; before the first one, a state of charge of 0.5 with the flag
 * GREYBOX_NOT_STARTED. */
greybox_status greybox_state(const greybox_estimator* estimator, greybox_estimate* estimate);

/* A status in words, never NULL. */
const char* greybox_status_text(greybox_status status);

/* The lowest of these flags in words; "" for 0. Never NULL. */
const char* greybox_flag_text(uint32_t flags);

/* Name of the compiled cell, and the first 32 bits of the SHA-256 of its file. */
const char* greybox_cell_name(void);
uint32_t greybox_cell_hash(void);

#ifdef __cplusplus
}
#endif

#endif
