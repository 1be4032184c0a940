/*
 * The state of a run as bytes that any other run of the same model can take, in this process or another: numbers of 8
 * bytes, without addresses. One description of what a state contains, below and in state.c, counts the bytes, writes and
 * reads them. Reading checks what is used as an index or a mode: no bytes lead beyond the run's memory.
 */
#ifndef LAGCLI_ARCHIVE_H
#define LAGCLI_ARCHIVE_H

#include "run.h"

enum lag_archive_use { LAG_COUNTS, LAG_WRITES, LAG_READS };

typedef struct {
    enum lag_archive_use use;
    char *at;                          /* the next byte; only read where that is its use */
    size_t bytes;                      /* so far; of what is read, those that are left */
    int damaged;                       /* whether what was read cannot be a state */
} lag_archive;

void lag_archive_reals(lag_archive *archive, double *x, int64_t count);

/* Integers from low to high. */
void lag_archive_count(lag_archive *archive, int64_t *x, int64_t low, int64_t high);
void lag_archive_int(lag_archive *archive, int *x, int low, int high);
void lag_archive_integers(lag_archive *archive, int *x, int count, int low, int high);

/* The state of a run between steps. What it leaves out is the same in all runs of a model, or computed again. A run
 * that reads has the memory that the other one had: `chosen` is the method of both. */
void lag_archive_run(lag_archive *archive, lag_run *run, const lag_method *chosen);

#endif
