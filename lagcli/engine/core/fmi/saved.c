/* The state of an instance as bytes: words of 8 bytes, a header, what was set, the simulation. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/instance.h"
#include "model/simulation.h"

#define STATE_MAGIC 0x3165746174736c6c /* "llstate1" where the lowest byte is the first */

enum { MAGIC, WORDS, IDENTITY, CHECKSUM, HEADER };

struct lag_fmu_state {
    size_t bytes;
    uint64_t words[];
};

/* Fowler, Noll and Vo's hash, FNV-1a, continued from one of other bytes. */
uint64_t lag_fmu_hash(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *at = data;
    for (size_t i = 0; i < bytes; ++i)
        hash = (hash ^ at[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static uint64_t checksum(const uint64_t *words, size_t bytes)
{
    return lag_fmu_hash(LAG_FMU_NO_HASH, words + HEADER, bytes - HEADER * sizeof *words);
}

/* What of an instance was set. */
static void archive_given(lag_archive *a, lag_fmu *fmu)
{
    int phase = (int)fmu->phase;
    lag_archive_int(a, &phase, LAG_FMU_MADE, LAG_FMU_FAILED);
    fmu->phase = (enum lag_fmu_phase)phase;
    lag_archive_int(a, &fmu->changed, 0, 1);
    lag_archive_reals(a, &fmu->started_at, 1);
    lag_archive_reals(a, &fmu->stop, 1);
    lag_archive_reals(a, fmu->given, fmu->settable);
    lag_archive_reals(a, fmu->initial, 2 * (int64_t)fmu->nq);
    lag_archive_integers(a, fmu->is_given, 2 * fmu->nq, LAG_FMU_NOT_GIVEN, LAG_FMU_GUESS);
    lag_archive_reals(a, fmu->taken, fmu->settable);
    /* forces are found by iterations that begin with the last ones: those evaluated again differ by rounding */
    lag_archive_int(a, &fmu->current, 0, 1);
    lag_archive_reals(a, fmu->values, fmu->count);
}

static int runs(const lag_fmu *fmu)
{
    return fmu->phase == LAG_FMU_STARTED || fmu->phase == LAG_FMU_ENDED;
}

static void archive(lag_archive *a, lag_fmu *fmu)
{
    archive_given(a, fmu);
    if (!runs(fmu) || a->damaged)
        return;
    if (a->use == LAG_READS && !fmu->simulation && lag_fmu_make_simulation(fmu, &fmu->model))
        a->damaged = 1;
    else
        lag_archive_simulation(a, fmu->simulation);
}

void lag_fmu_forget(lag_fmu_state *state)
{
    free(state);
}

lag_fmu_state *lag_fmu_save(lag_fmu *fmu)
{
    lag_archive count = {.use = LAG_COUNTS};
    archive(&count, fmu);
    const size_t bytes = HEADER * sizeof(uint64_t) + count.bytes;
    lag_fmu_state *state = count.damaged ? NULL : malloc(sizeof *state + bytes);
    if (!state) {
        lag_fmu_fail(fmu, count.damaged ? "the state cannot be saved" : "there is no memory");
        return NULL;
    }
    lag_archive write = {.use = LAG_WRITES, .at = (char *)(state->words + HEADER)};
    archive(&write, fmu);
    state->bytes = bytes;
    state->words[MAGIC] = STATE_MAGIC;
    state->words[WORDS] = bytes / sizeof(uint64_t);
    state->words[IDENTITY] = fmu->identity + (unsigned)fmu->exchange;
    state->words[CHECKSUM] = checksum(state->words, bytes);
    return state;
}

int lag_fmu_restore(lag_fmu *fmu, lag_fmu_state *state)
{
    lag_archive read = {.use = LAG_READS, .at = (char *)(state->words + HEADER),
                        .bytes = state->bytes - HEADER * sizeof(uint64_t)};
    archive(&read, fmu);
    if (read.damaged || read.bytes) {
        lag_fmu_reset(fmu);
        fmu->phase = LAG_FMU_FAILED;
        return lag_fmu_fail(fmu, "the saved state is damaged");
    }
    if (runs(fmu))
        lag_wait(fmu->simulation, fmu->has_event_mode);
    else
        lag_fmu_end_simulation(fmu);
    fmu->current &= runs(fmu);
    return 0;
}

const void *lag_fmu_bytes_of(const lag_fmu_state *state, size_t *bytes)
{
    *bytes = state ? state->bytes : 0;
    return state ? state->words : NULL;
}

lag_fmu_state *lag_fmu_state_from(const lag_fmu *fmu, const void *from, size_t bytes)
{
    lag_fmu_state *state = NULL;
    if (from && bytes >= HEADER * sizeof(uint64_t) && bytes % sizeof(uint64_t) == 0)
        state = malloc(sizeof *state + bytes);
    if (!state) {
        lag_fmu_fail(fmu, "these bytes are no state");
        return NULL;
    }
    state->bytes = bytes;
    memcpy(state->words, from, bytes);
    const uint64_t *words = state->words;
    const char *wrong = words[MAGIC] != STATE_MAGIC || words[WORDS] != bytes / sizeof *words ? "these bytes are no state"
                        : words[IDENTITY] != fmu->identity + (unsigned)fmu->exchange
                            ? "the state is that of another FMU, of another kind or of another version of lagcli"
                        : words[CHECKSUM] != checksum(words, bytes) ? "the saved state is damaged"
                                                                    : NULL;
    if (wrong) {
        free(state);
        lag_fmu_fail(fmu, wrong);
        return NULL;
    }
    return state;
}
