#include "parts.h"

#include <math.h>
#include <string.h>

#include "batch/batch.h"
#include "bind.h"
#include "contact/modes.h"
#include "linear/ldl.h"
#include "methods/radau5_tableau.h"
#include "methods/rodas5p_tableau.h"
#include "motion.h"
#include "switching/crossing.h"
#include "switching/enclosure.h"
#include "tape/interval.h"
#include "tape/vectors.h"
#include "watch.h"

void lag_part_run(int kernel, const int32_t *stream, double *registers)
{
    lag_vectors(kernel)->run(stream, registers);
}

struct lag_part_code {
    lag_pool pool;
    int lanes;
    lag_tape one;
    lag_batch_tape eight;
};

static lag_routine *routine_at(lag_part_code *code, int i)
{
    lag_routine *of_one[] = {&code->one.stream, code->one.deferred, code->one.deferred + 1, code->one.deferred + 2,
                             code->one.output_subsets, code->one.output_subsets + 1};
    lag_routine *of_eight[] = {&code->eight.stream, code->eight.deferred, code->eight.deferred + 1,
                               code->eight.deferred + 2, code->eight.output_subsets, code->eight.output_subsets + 1};
    return code->lanes > 1 ? of_eight[i] : of_one[i];
}

lag_part_code *lag_part_code_create(const lag_program *program, int lanes, int emit)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_part_code *made = lag_get(&pool, 1, sizeof *made);
    if (!made)
        return NULL;
    made->pool = pool;
    made->lanes = lanes;
    if (lanes > 1)
        lag_batch_bind(&made->pool, &made->eight, program, LAG_NATIVE);
    else
        lag_bind_program(&made->pool, &made->one, program, LAG_NATIVE);
    for (int i = 0; emit && i < LAG_ROUTINES; ++i)
        if (routine_at(made, i)->native)
            routine_at(made, i)->native->wait = 1;
    return made;
}

void lag_part_code_destroy(lag_part_code *code)
{
    lag_pool pool = code->pool; /* it is allocated in it */
    lag_release(&pool);
}

void lag_part_code_run(lag_part_code *code, int i, double *registers, int64_t times)
{
    const lag_routine *routine = routine_at(code, i);
    lag_tape one = code->one;
    lag_batch_tape eight = code->eight;
    one.registers = eight.registers = registers;
    for (int64_t k = 0; k < times; ++k)
        if (code->lanes > 1)
            lag_batch_lanes(LAG_NATIVE)->run(&eight, routine);
        else
            lag_tape_run(&one, routine);
}

int64_t lag_part_code_size(lag_part_code *code, int i)
{
    const lag_native *native = routine_at(code, i)->native;
    return native && native->run ? (int64_t)native->bytes : 0;
}

int lag_part_enclose(const lag_program *program, const double *inputs, double high, int order, int narrowed,
                     double *out)
{
    return lag_enclose_program(NULL, program, inputs, high, order, narrowed, out);
}

int lag_part_ldl(const lag_elimination *plan, int kernel, double *factors, double *product, double *work, double *x)
{
    lag_pool pool = lag_pool_of(NULL);
    lag_supernodes nodes;
    const int bad = !lag_ldl_closed(plan) || lag_supernodes_of(&pool, plan, &nodes);
    if (!bad) {
        lag_ldl_factor(plan, &nodes, lag_vectors(kernel), factors, product);
        lag_ldl_solve(plan, factors, work, x);
    }
    lag_release(&pool);
    return bad;
}

size_t lag_part_contact_memory(int n)
{
    return lag_contact_memory(n);
}

int lag_part_contacts(const lag_contacts *problem, const int *present, void *memory, lag_contact_motion *first,
                      lag_contact_motion *second)
{
    return lag_solve_contacts(problem, present, memory, first, second);
}

int lag_part_lemke(const lag_contacts *problem, void *memory, int *mode)
{
    lag_contact_work work;
    lag_contact_prepare(&work, problem, memory);
    const int solved = lag_contact_lemke(&work);
    memcpy(mode, work.mode, (size_t)problem->n * sizeof *mode);
    lag_contact_rouse(&work, work.mode);
    return solved ? 1 + lag_contact_try(&work) : 0;
}

int lag_part_share(const lag_contacts *problem, const int *mode, void *memory, double *force, double *slack,
                   int *tight)
{
    return lag_share_contacts(problem, mode, memory, force, slack, tight);
}

int lag_part_least_distance(int n, int m, double *normal, const double *bound, double *z, double *scratch, int *place)
{
    return lag_least_distance(n, m, normal, bound, z, scratch, place);
}

size_t lag_part_impact_memory(int n)
{
    return lag_impact_memory(n);
}

int lag_part_impact(const lag_impact *impact, int law, void *memory, lag_impact_result *result)
{
    return lag_solve_impact(impact, law, memory, result);
}

double lag_part_bracketed_root(lag_scalar_function f, void *context, double low, double high, double a, double b,
                               double exact)
{
    return lag_bracketed_root(f, context, low, high, a, b, exact);
}

double lag_part_last_digit_root(lag_scalar_function f, void *context, double low, double high)
{
    return lag_last_digit_root(f, context, low, high);
}

double lag_part_node(int k)
{
    return lag_node(k);
}

void lag_part_bernstein_matrix(double *matrix)
{
    lag_bernstein_matrix(matrix);
}

int lag_part_resolved(const double *values)
{
    return lag_resolved(values);
}

int lag_part_first_change(const double *bernstein, double from, double *low, double *high)
{
    return lag_first_change(bernstein, from, low, high);
}

double lag_part_estimate_root(const double *bernstein, double low, double high)
{
    return lag_estimate_root(bernstein, low, high);
}

void lag_part_enclose_watched(lag_run *run, int k, double a, double b, int order, double *step, double *over, double *out)
{
    lag_interval jet[JET];
    step[0] = run->step.t_old;
    step[1] = run->step.h_old;
    lag_enclosure_begin(run, run->step.f_new);
    const lag_interval whole = lag_enclose_step(run, k);
    memcpy(over, &whole, sizeof whole);
    lag_enclose(run, k, step[0] + a * step[1], step[0] + b * step[1], order, jet);
    memcpy(out, jet, (size_t)(order + 1) * sizeof *jet);
}

void lag_part_search_cost(const lag_run *run, int64_t *coefficients, int64_t *states)
{
    *coefficients = run->switching.enclosure.work;
    *states = run->switching.looks;
}

int lag_part_watch(lag_run *run, double t, const double *y, double *determinant, double *pivot)
{
    if (lag_derivative(run, t, y, run->step.f_new))
        return 1;
    *determinant = lag_log_determinant(run);
    *pivot = lag_least_pivot(run, t, y);
    return 0;
}

int lag_part_steps_over(lag_run *run, double h, double speed, const double *before, const double *after)
{
    const size_t size = (size_t)lag_size(&run->system) * sizeof(double);
    memcpy(run->step.y_old, before, size);
    memcpy(run->step.y_new, after, size);
    run->step.t_old = run->step.t;
    run->step.t += run->step.h_old = h;
    run->watch.path.speed = speed;
    run->watch.path.length = INFINITY;
    return lag_stepped_over(run);
}

int lag_part_path(lag_run *run, int count, const double *times, const double *states, double *path)
{
    const size_t size = lag_size(&run->system);
    const double *last = states + (count - 1) * size;
    for (int tried = 0; tried < 2; ++tried) { /* the step is repeated */
        lag_watch_step(run);
        for (int i = 1; i < count; ++i) {
            if (lag_stage(run, times[i], states + i * size, run->step.f_new))
                return -1;
            lag_watch_determinant(run, times[i]);
        }
    }
    memcpy(run->step.y_old, states, size * sizeof *states);
    memcpy(run->step.y_new, last, size * sizeof *states);
    run->step.t_old = times[0];
    run->step.h_old = times[count - 1] - times[0];
    const int over = lag_stepped_over(run);
    path[0] = run->watch.path.length;
    path[1] = run->watch.path.speed;
    path[2] = run->watch.path.margin_at_end;
    lag_watch_accept(run);
    path[3] = lag_approaches(run);
    run->step.t = times[count - 1];
    return over;
}

void lag_part_measure(lag_run *run, double t, const double *y)
{
    lag_evaluate(&run->system.constraint, &run->system, t, y, LAG_ALL);
    lag_measure(run);
}

int lag_part_is_smooth(int count, const double *times, const double *values)
{
    lag_determinant d = {.count = count};
    memcpy(d.t, times, (size_t)count * sizeof *times);
    memcpy(d.value, values, (size_t)count * sizeof *values);
    return lag_is_smooth_in_step(&d);
}

int lag_part_approaches(lag_run *run, double t, const double *y)
{
    run->watch.pivot_at_end = lag_least_pivot(run, t, y);
    run->watch.largest_pivot = fmax(run->watch.largest_pivot, run->watch.pivot_at_end);
    return lag_approaches(run);
}

int lag_part_follow_approach(lag_run *run, double t, const double *y, double *h_max, int *near)
{
    const size_t size = (size_t)lag_size(&run->system) * sizeof *y;
    memcpy(run->step.y_old, run->step.y, size);
    memcpy(run->step.y_new, y, size);
    memcpy(run->step.y, y, size);
    run->step.t_old = run->step.t;
    run->step.h_old = t - run->step.t;
    run->step.t = t;
    ++run->step.steps;
    run->watch.path.length = INFINITY;
    lag_stepped_over(run);
    const int status = lag_follow_approach(run);
    *h_max = run->step.h_max;
    *near = lag_is_near(run);
    return status;
}

void lag_part_coefficients(lag_rodas5p_coefficients *rodas5p, lag_radau5_coefficients *radau5)
{
    rodas5p->gamma = rodas_gamma;
    memcpy(rodas5p->c, rodas_c, sizeof rodas_c);
    memcpy(rodas5p->d, rodas_d, sizeof rodas_d);
    memcpy(rodas5p->a, rodas_a, sizeof rodas_a);
    memcpy(rodas5p->C, rodas_C, sizeof rodas_C);
    memcpy(rodas5p->h, rodas_h, sizeof rodas_h);
    memcpy(radau5->c, radau_c, sizeof radau_c);
    memcpy(radau5->t, radau_t, sizeof radau_t);
    memcpy(radau5->t_inverse, radau_t_inverse, sizeof radau_t_inverse);
    radau5->real = radau_real;
    radau5->re = radau_re;
    radau5->im = radau_im;
    memcpy(radau5->error, radau_error, sizeof radau_error);
    radau5->defect = radau_defect;
    radau5->zero = radau_zero;
}

const double *lag_part_acceleration_terms(const lag_run *run)
{
    return run->tolerances.acceleration_terms;
}
