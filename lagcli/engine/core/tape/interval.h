/*
 * Interval evaluation of tapes: enclosures of outputs and of their derivatives with respect to time.
 *
 * A jet holds the Taylor coefficients of a function about each time of an interval: coefficient k encloses
 * the k-th derivative over k! on the whole interval. Results are rounded outwards, so that the enclosures are
 * rigorous for the inputs' enclosures. An output that is undefined somewhere has unbounded coefficients.
 */
#ifndef LAGCLI_INTERVAL_H
#define LAGCLI_INTERVAL_H

#include <math.h>

#include "memory.h"
#include "tape/tape.h"

#define JET_ORDER 4         /* the highest */
#define JET (JET_ORDER + 1) /* coefficients of a jet */

typedef struct {
    double low, high;
} lag_interval;

#define LAG_ANYTHING ((lag_interval){-INFINITY, INFINITY})

/* A tape's registers as jets. */
typedef struct {
    const lag_tape *tape;
    int inputs;                        /* t, q and v: those before the parameters */
    int64_t count;                     /* of registers */
    lag_interval *registers;           /* JET each */
    char *used;                        /* inputs: whether an operation or an output reads them */
    int undefined;                     /* whether an operation was undefined in all of the interval */
    int stale;                         /* whether the parameters have changed since the registers were filled */
} lag_jet_tape;

/* Allocate the registers of a bound tape of `program`. Its parameters are the last `np` inputs. */
void lag_jets_bind(lag_jet_tape *jets, lag_pool *pool, const lag_tape *tape, const lag_program *program, int np);

/* Use registers that are allocated for another bound tape; without `used`. */
void lag_jets_of_tape(lag_jet_tape *jets, const lag_tape *tape);

/* The jet of input i, to be set before lag_jets_run. */
static inline lag_interval *lag_jet_input(const lag_jet_tape *jets, int i)
{
    return jets->registers + (int64_t)JET * i;
}

/* The jet of output i. */
static inline const lag_interval *lag_jet_output(const lag_jet_tape *jets, int i)
{
    return jets->registers + (int64_t)JET * jets->tape->outputs[i];
}

/* Fill registers that do not depend on t, q or v, if they are stale. */
void lag_jets_refresh(lag_jet_tape *jets);

/* Evaluate the tape: coefficients 0 to `order` of all outputs. */
void lag_jets_run(lag_jet_tape *jets, int order);

/* Evaluate a part of the tape, a stream of its own, alone. */
void lag_jets_run_part(lag_jet_tape *jets, const lag_stream *part, int order);

/* The same where the inputs of `middle` are jets at the middle of the interval, whose ends are at most `radius` away. Each
 * result is narrowed to what its derivatives allow: inputs that move together do not cancel in ranges of their values,
 * but in those of their derivatives. */
void lag_jets_run_about(lag_jet_tape *jets, lag_jet_tape *middle, double radius, int order);

/* Enclose a program of inputs with t in [low, high] and others fixed: `inputs`, low of t included. Bounds of all
 * coefficients of all outputs, order by order, to out; `narrowed` as by lag_jets_run_about. Returns 0, or 1 where there
 * is no memory. */
int lag_enclose_program(const lag_memory *memory, const lag_program *program, const double *inputs, double high,
                        int order, int narrowed, double *out);

/* Without calls of the C library, which take longer than the comparison. */
static inline double lag_least(double a, double b)
{
    return a < b ? a : b;
}

static inline double lag_most(double a, double b)
{
    return a > b ? a : b;
}

/* Arithmetic, rounded outwards. */
lag_interval lag_interval_add(lag_interval a, lag_interval b);
lag_interval lag_interval_multiply(lag_interval a, lag_interval b);
lag_interval lag_interval_scale(lag_interval a, double s);

/* The larger magnitude of the bounds; 1 or -1 where all numbers have that sign, else 0. */
double lag_interval_size(lag_interval a);
int lag_interval_sign(lag_interval a);

/* The product of two jets, to c, which may be neither. */
void lag_jet_multiply(const lag_interval *a, const lag_interval *b, lag_interval *c, int order);

#endif
