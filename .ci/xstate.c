/* Lets a user-mode Linux of 6.1 run on a processor with AMX, as a library that is loaded before libc.

   That kernel keeps 2,696 bytes of its guest's extended registers. A host whose own set is larger (11,008 bytes
   with AMX) hands out a part of it, but takes back only the whole: the guest's first process dies, and the kernel
   panics. Here the rest of the set goes back as it was read. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

static unsigned char registers[65536];

long ptrace(enum __ptrace_request request, ...)
{
    static long (*of_libc)(enum __ptrace_request, pid_t, void *, void *);
    va_list arguments;
    va_start(arguments, request);
    pid_t pid = va_arg(arguments, pid_t);
    void *address = va_arg(arguments, void *);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (!of_libc)
        of_libc = (long (*)(enum __ptrace_request, pid_t, void *, void *))dlsym(RTLD_NEXT, "ptrace");
    struct iovec *part = data, whole = {registers, sizeof registers};
    if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE &&
        of_libc(PTRACE_GETREGSET, pid, address, &whole) == 0 && part->iov_len < whole.iov_len) {
        memcpy(registers, part->iov_base, part->iov_len);
        data = &whole;
    }
    return of_libc(request, pid, address, data);
}
