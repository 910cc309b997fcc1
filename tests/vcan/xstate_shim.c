/* Lets Debian 12's User-Mode Linux (6.1) run on processors whose extended state is larger than the 2,696 bytes that it
 * saves (AMX has 11,008). The host's kernel rejects a partial state with EFAULT. This preloaded ptrace() reads the
 * whole state, copies the caller's part over it and writes the whole state. On other processors it has no effect. */
#define _GNU_SOURCE
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

/* As in the C library: a peeked word is returned as the result. */
static long kernel_ptrace(long request, long pid, void* address, void* data) {
  long peeked = 0;
  const int peeks = request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER;
  const long result = syscall(SYS_ptrace, request, pid, address, peeks ? (void*)&peeked : data);
  if (!peeks || result < 0) return result;
  errno = 0;
  return peeked;
}

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  const long pid = va_arg(arguments, int);
  void* address = va_arg(arguments, void*);
  void* data = va_arg(arguments, void*);
  va_end(arguments);
  if ((long)request == PTRACE_SETREGSET && (unsigned long)address == NT_X86_XSTATE) {
    static unsigned char state[1 << 16] __attribute__((aligned(64)));
    const struct iovec* part = data;
    struct iovec whole = {state, sizeof state};
    if (kernel_ptrace(PTRACE_GETREGSET, pid, address, &whole) == 0 && whole.iov_len > part->iov_len) {
      memcpy(state, part->iov_base, part->iov_len);
      return kernel_ptrace(PTRACE_SETREGSET, pid, address, &whole);
    }
  }
  return kernel_ptrace(request, pid, address, data);
}
