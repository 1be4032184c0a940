#include "evaluate.h"

#include <math.h>
#include <string.h>

#include "methods/implicit_data.h"

/* Whether n numbers are bitwise equal. */
static int same(int n, const double *x, const double *y)
{
    for (int i = 0; i < n; ++i) {
        uint64_t a, b;
        memcpy(&a, x + i, sizeof a);
        memcpy(&b, y + i, sizeof b);
        if (a != b)
            return 0;
    }
    return 1;
}

void lag_evaluate(const lag_tape *tape, const lag_system *s, double t, const double *y, int part)
{
    double *r = tape->registers;
    if (part && !tape->output_subsets[part - 1].code)
        part = LAG_ALL;
    if (r[0] == t && same(2 * s->nq, r + 1, y)) {
        if (tape->held[0] == LAG_ALL || tape->held[0] == part)
            return;
    } else {
        r[0] = t;
        memcpy(r + 1, y, 2 * (size_t)s->nq * sizeof(double));
    }
    tape->held[0] = part;
    tape->held[1] = LAG_NOT_FACTORED;
    lag_tape_run(tape, part ? &tape->output_subsets[part - 1] : &tape->stream);
}

void lag_evaluate_slice(const lag_tape *tape, const lag_slice *slice, double t, const double *y)
{
    double *r = tape->registers;
    for (int i = 0; i < slice->count; ++i) {
        const int32_t input = slice->inputs[i];
        r[input] = input ? y[input - 1] : t;
    }
    tape->held[0] = LAG_NOTHING;
    tape->vectors->run(slice->stream.code, r);
}

const lag_tape *lag_equations_tape(const lag_system *s)
{
    const lag_tape *d = &s->dynamics, *e = &s->equations;
    if (!e->registers)
        return d;
    lag_evaluate(e, s, d->registers[0], d->registers + 1, LAG_ALL);
    return e;
}

void lag_renew_tapes(lag_run *run)
{
    lag_switching *sw = &run->switching;
    lag_derivatives *w = &run->derivatives;
    lag_tape *tapes[] = {&run->system.dynamics, &run->system.equations, &run->system.constraint, &run->system.tangent,
                         &run->series.values, run->implicit ? &run->implicit->variation : NULL, &sw->functions,
                         &sw->limits, &sw->impact, &sw->forces, &sw->condition_tape, &sw->force_condition_tape,
                         &sw->sign_tape, &sw->kinks.tape, &sw->enclosure.gaps, &w->dynamics, &w->constraint,
                         &w->functions, &w->limits, &w->impact, &w->forces, &w->signs, &w->conditions,
                         &w->force_conditions, &w->kinks, &w->kink_rates, &run->resolution.tape};
    for (size_t i = 0; i < sizeof tapes / sizeof *tapes; ++i)
        if (tapes[i] && tapes[i]->registers)
            lag_tape_set(tapes[i], run->np, run->parameters);
    for (int i = 0; i < LAG_ENCLOSED_TAPES; ++i)
        sw->enclosure.tapes[i].stale = 1;
    run->resolution.jets.stale = run->resolution.middle.stale = 1;
    if (run->series.order)
        lag_series_invariant(&run->series);
}

void lag_row_squares(const lag_system *s, const lag_tape *tape, int first, const double *sizes,
                     double *sum)
{
    memset(sum, 0, (size_t)s->nc * sizeof(double));
    for (int i = 0; i < s->nb; ++i) {
        const double x = OUT(tape, first + i) * (sizes ? sizes[s->jacobian_column[i]] : 1.0);
        sum[s->jacobian_row[i]] += x * x;
    }
}

int lag_scaled_rows(lag_run *run, int blocks, const lag_tape *tape, int first)
{
    const lag_system *s = &run->system;
    const int nq = s->nq / s->blocks * blocks, nc = s->nc / s->blocks * blocks;
    double sum = 0.0;
    memset(run->rows.scaled, 0, (size_t)nq * nc * sizeof(double));
    for (int i = 0; i < s->nb / s->blocks * blocks; ++i) {
        const int row = s->jacobian_row[i], column = s->jacobian_column[i];
        const double x = OUT(tape, first + i) * run->rows.sizes[column] / run->rows.lengths[row];
        run->rows.scaled[row * nq + column] = x;
        sum += x;
    }
    return !isfinite(sum);
}

int lag_failed(lag_run *run, double t, const double *y)
{
    run->failure.t = t;
    memcpy(run->failure.y, y, (size_t)lag_size(&run->system) * sizeof(double));
    return 1;
}
