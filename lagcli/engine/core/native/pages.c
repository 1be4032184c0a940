#if defined(__APPLE__)
#define _DARWIN_C_SOURCE /* MAP_JIT */
#else
#define _DEFAULT_SOURCE  /* MAP_ANONYMOUS */
#endif
#include "native/pages.h"

#include "native/machine.h"

#include <string.h>

#if !defined(LAG_MACHINE)
static void *writable(size_t bytes)
{
    (void)bytes;
    return NULL;
}

static int make_executable(void *at, size_t bytes)
{
    (void)at, (void)bytes;
    return 0;
}

static void unmap(void *at, size_t bytes)
{
    (void)at, (void)bytes;
}
#elif defined(_WIN32)
#include <windows.h>

static void *writable(size_t bytes)
{
    return VirtualAlloc(NULL, bytes, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
}

static int make_executable(void *at, size_t bytes)
{
    DWORD before;
    return VirtualProtect(at, bytes, PAGE_EXECUTE_READ, &before)
           && FlushInstructionCache(GetCurrentProcess(), at, bytes);
}

static void unmap(void *at, size_t bytes)
{
    (void)bytes;
    VirtualFree(at, 0, MEM_RELEASE);
}
#else
#include <sys/mman.h>

#if !defined(MAP_JIT)
#define MAP_JIT 0 /* macOS: hardened programs may make such pages alone executable */
#endif

static void *writable(size_t bytes)
{
    void *at = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_JIT, -1, 0);
    return at == MAP_FAILED ? NULL : at;
}

static int make_executable(void *at, size_t bytes)
{
    return mprotect(at, bytes, PROT_READ | PROT_EXEC) == 0;
}

static void unmap(void *at, size_t bytes)
{
    munmap(at, bytes);
}
#endif

int lag_pages_make(lag_pages *pages, const void *code, size_t bytes)
{
    void *at = writable(bytes);
    *pages = (lag_pages){0};
    if (!at)
        return 1;
    memcpy(at, code, bytes);
    if (!make_executable(at, bytes)) {
        unmap(at, bytes);
        return 1;
    }
    *pages = (lag_pages){at, bytes};
    return 0;
}

void lag_pages_release(lag_pages *pages)
{
    if (pages->at)
        unmap(pages->at, pages->bytes);
    *pages = (lag_pages){0};
}
