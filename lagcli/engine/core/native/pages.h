/* Memory for machine code: writable first, then executable, never both. */
#ifndef LAGCLI_NATIVE_PAGES_H
#define LAGCLI_NATIVE_PAGES_H

#include <stddef.h>

typedef struct {
    void *at;                          /* NULL: none */
    size_t bytes;
} lag_pages;

/* Put code in pages of its own. Returns 0, or 1 where the system refuses. */
int lag_pages_make(lag_pages *pages, const void *code, size_t bytes);
void lag_pages_release(lag_pages *pages);

#endif
