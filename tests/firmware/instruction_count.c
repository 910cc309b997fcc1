/* QEMU TCG plugin: how many instructions a call of one function takes, whatever it calls included.
 *
 *   -plugin ./instruction_count.so,entry=HEX,skip=HEX-HEX[,profile=FILE]
 *
 * entry    address of the function
 * skip     address range of an interrupt's handler that may come in between; not counted
 * profile  file for lines "address count": how often each instruction ran, in the whole run
 *
 * At the end one line goes to the plugin log (-d plugin -D FILE):
 *
 *   calls N first N min N max N sum N       first: the first call; min, max and sum: of the others
 *
 * A call is over when its return address is reached: that follows the branch that led to the entry. Instructions, not
 * cycles; those that an IT block skips count as executed. The same number in every run.
 *
 *   gcc -O2 -shared -fPIC instruction_count.c -o instruction_count.so
 *
 * Debian packs no qemu-plugin.h; what is used of it (plugin API 1, QEMU 4.2 to 8.x) is declared here. */
#include <inttypes.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info_t;
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };

typedef void (*qemu_plugin_tb_trans_cb)(qemu_plugin_id_t, struct qemu_plugin_tb*);
typedef void (*qemu_plugin_exec_cb)(unsigned vcpu, void* user);
typedef void (*qemu_plugin_exit_cb)(qemu_plugin_id_t, void* user);

extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, qemu_plugin_tb_trans_cb);
extern void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb*, qemu_plugin_exec_cb, enum qemu_plugin_cb_flags,
                                                 void* user);
extern void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn*, enum qemu_plugin_op, void* counter,
                                                       uint64_t step);
extern void qemu_plugin_register_atexit_cb(qemu_plugin_id_t, qemu_plugin_exit_cb, void* user);
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb*);
extern uint64_t qemu_plugin_tb_vaddr(const struct qemu_plugin_tb*);
extern struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb*, size_t);
extern size_t qemu_plugin_insn_size(const struct qemu_plugin_insn*);
extern uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn*);
extern void qemu_plugin_outs(const char*);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

enum { flash_size = 1 << 20 }; /* it begins where `entry` is, to the MiB */

/* A piece of code without a branch inside, as QEMU translated it. Never freed: QEMU may run it again. */
struct block {
  uint64_t start, end, instructions;
};

static uint64_t entry, flash, skip_from, skip_to;
static const char* profile;
static uint64_t ran[flash_size / 2]; /* per halfword of flash */

static bool inside;
static uint64_t last_end, return_to, in_this_call;
static uint64_t calls, first, least = UINT64_MAX, most, sum;

static void call_ended(void) {
  inside = false;
  if (calls++ == 0) {
    first = in_this_call;
    return;
  }
  if (in_this_call < least) least = in_this_call;
  if (in_this_call > most) most = in_this_call;
  sum += in_this_call;
}

static void on_block(unsigned vcpu, void* user) {
  const struct block* b = user;
  (void)vcpu;
  if (b->start >= skip_from && b->start < skip_to) return;
  if (inside && b->start == return_to) call_ended();
  if (!inside && b->start == entry) {
    inside = true;
    return_to = last_end;
    in_this_call = 0;
  }
  if (inside) in_this_call += b->instructions;
  last_end = b->end;
}

static void on_translation(qemu_plugin_id_t id, struct qemu_plugin_tb* tb) {
  const size_t n = qemu_plugin_tb_n_insns(tb);
  struct qemu_plugin_insn* last = qemu_plugin_tb_get_insn(tb, n - 1);
  struct block* b = malloc(sizeof *b);
  (void)id;
  if (b == NULL) abort();
  *b = (struct block){qemu_plugin_tb_vaddr(tb), qemu_plugin_insn_vaddr(last) + qemu_plugin_insn_size(last), n};
  qemu_plugin_register_vcpu_tb_exec_cb(tb, on_block, QEMU_PLUGIN_CB_NO_REGS, b);
  if (profile == NULL) return;
  for (size_t i = 0; i < n; ++i) {
    struct qemu_plugin_insn* insn = qemu_plugin_tb_get_insn(tb, i);
    const uint64_t at = qemu_plugin_insn_vaddr(insn) - flash;
    if (at < flash_size) qemu_plugin_register_vcpu_insn_exec_inline(insn, QEMU_PLUGIN_INLINE_ADD_U64, &ran[at / 2], 1);
  }
}

static void on_exit_of_qemu(qemu_plugin_id_t id, void* user) {
  char line[200];
  (void)id, (void)user;
  snprintf(line, sizeof line, "calls %" PRIu64 " first %" PRIu64 " min %" PRIu64 " max %" PRIu64 " sum %" PRIu64 "\n",
           calls, first, calls > 1 ? least : 0, most, sum);
  qemu_plugin_outs(line);
  FILE* file = profile != NULL ? fopen(profile, "w") : NULL;
  if (file == NULL) return;
  for (size_t i = 0; i < flash_size / 2; ++i) {
    if (ran[i] != 0) fprintf(file, "%08" PRIx64 " %" PRIu64 "\n", flash + 2 * i, ran[i]);
  }
  fclose(file);
}

__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const struct qemu_info_t* info,
                                                               int argc, char** argv) {
  (void)info;
  for (int i = 0; i < argc; ++i) {
    char* value = strchr(argv[i], '=');
    if (value == NULL) return 1;
    ++value;
    if (strncmp(argv[i], "entry=", 6) == 0) {
      entry = strtoull(value, NULL, 16);
      flash = entry & ~(uint64_t)(flash_size - 1);
    } else if (strncmp(argv[i], "skip=", 5) == 0) {
      char* dash;
      skip_from = strtoull(value, &dash, 16);
      skip_to = *dash == '-' ? strtoull(dash + 1, NULL, 16) : skip_from;
    } else if (strncmp(argv[i], "profile=", 8) == 0) {
      profile = strdup(value);
    } else {
      return 1;
    }
  }
  if (entry == 0) return 1;
  qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation);
  qemu_plugin_register_atexit_cb(id, on_exit_of_qemu, NULL);
  return 0;
}
