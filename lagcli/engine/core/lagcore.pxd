# The public interface of the core, core/lagcore.h and core/lagbatch.h, for the binding.

from libc.stdint cimport int32_t, int64_t


cdef extern from "lagcore.h" nogil:
    ctypedef struct lag_memory:
        void *(*allocate)(void *context, size_t size) noexcept nogil
        void (*release)(void *context, void *memory) noexcept nogil
        void *context

    ctypedef struct lag_stream:
        const int32_t *code
        long length

    ctypedef struct lag_program:
        lag_stream prelude, main
        lag_stream deferred[3]
        lag_stream output_subsets[2]
        int inputs
        const double *registers
        long register_count
        const int32_t *outputs
        long output_count

    ctypedef struct lag_equations:
        int nq, nc, nh, np
        const int32_t *holonomic
        int nm, nb
        const int32_t *mass_row
        const int32_t *mass_column
        const int32_t *jacobian_row
        const int32_t *jacobian_column
        const int32_t *unit
        lag_program constraint

    ctypedef struct lag_settings:
        double t_start, t_end, h_max
        const double *y
        const double *parameters
        double rtol
        const double *atol
        const int32_t *kind
        int rank
        const double *sizes
        const double *lengths
        const double *plain_lengths
        int projecting, baumgarte
        double alpha, beta
        int watching, detecting, refinable
        const double *times
        long times_count
        double *block
        long block_rows
        int extra, directions

    ctypedef struct lag_elimination:
        int n
        const int32_t *order
        const int32_t *paired
        const int32_t *start
        const int32_t *row
        const int32_t *left_start
        const int32_t *left_column
        const int32_t *left_entry
        const int32_t *mass_targets
        const int32_t *jacobian_targets

    ctypedef struct lag_series_program:
        lag_program values
        lag_stream stream
        int convolutions, order, invariant, numbers
        const int32_t *begins
        int begin_count, origin, layer
        const int32_t *state
        long size

    ctypedef struct lag_block:
        int count
        const int32_t *places

    ctypedef struct lag_jacobians:
        lag_program program
        lag_block force_position, force_velocity, rhs_position, rhs_velocity
        lag_block power_position, power_velocity
        int n
        const int32_t *start
        const int32_t *columns
        const int32_t *parts
        long parts_count

    ctypedef struct lag_pivots:
        int n
        const int32_t *row
        const int32_t *column
        const int32_t *start
        const int32_t *columns
        const int32_t *diagonal
        const int32_t *places

    ctypedef struct lag_function:
        int first, degree
        long count
        const double *knots
        const double *origins
        const double *coefficients
        double period

    ctypedef struct lag_report:
        double t_old, t
        const double *y
        const double *atol
        const double *lengths
        long steps, rejected, evaluations, times_next
        double t_bad
        const double *y_bad

    ctypedef struct lag_run
    ctypedef struct lag_method

    const lag_method *lag_method_at(int i)
    const char *lag_method_name(const lag_method *method)
    lag_run *lag_create(
        const lag_memory *memory, const lag_equations *equations, const lag_settings *settings)
    void lag_destroy(lag_run *run)
    int lag_use_dense(lag_run *run, const lag_program *dynamics)
    int lag_use_elimination(
        lag_run *run, const lag_program *dynamics, const lag_elimination *plan)
    int lag_use_unrolled(lag_run *run, const lag_program *dynamics)
    int lag_allow_dense(lag_run *run, long steps)
    int lag_use_series(lag_run *run, const lag_series_program *program)
    int lag_use_jacobians(lag_run *run, const lag_jacobians *jacobians)
    ctypedef struct lag_switching_rules:
        int rows, exported, nc
        const int32_t *constraint
        const int32_t *base
        const int32_t *law
        const int32_t *limit
        const int32_t *normal
        const int32_t *place
        const double *sign
        const int32_t *active
        const int32_t *friction
        const int32_t *restitution
        int nb, nh
        const int32_t *row
        const int32_t *column
        lag_program functions, gaps, limits
        int nl, pattern_count
        const int32_t *pattern_limit
        const int32_t *pattern_row
        lag_program impact
        int nf, force_count
        const int32_t *force_coordinate
        const int32_t *force_row
        const int32_t *force_constraint
        lag_program forces
        int conditions, force_conditions
        lag_program condition_functions, force_condition_functions
        const int32_t *either
        const int32_t *time
        int clocks
        const double *ticks
        const int32_t *most
        const int32_t *reported
        int kinks, first_branch
        const int32_t *whole
        const int32_t *of_time
        lag_program kink_functions
        int law_of_impact
        double closed
        double *log
        long log_rows

    ctypedef struct lag_instant_report:
        double t
        const double *y
        const int *mode
        const int *active
        const double *gap
        const double *speed
        const double *force
        double gained
        int rubbed, alike
        const int *takes_part
        double margin
        int found, begun
        const int *first_mode
        const double *before
        const double *a
        const double *multipliers
        long crossed, slid
        const int *kinks
        const double *branches
        int undetermined, which

    ctypedef struct lag_directions:
        int parameters
        const double *p
        const int32_t *decides
        lag_program dynamics, constraint, functions, limits, impact, forces
        lag_program conditions, force_conditions, kinks, kink_rates

    ctypedef struct lag_loss_report:
        int lost, reason, count
        double t
        const int *what
        const int *which

    ctypedef struct lag_contact_report:
        int n
        const int *row
        const int *law
        const double *matrix
        const double *offset
        const double *static_limit
        const double *static_slope
        const double *kinetic_limit
        const double *kinetic_slope
        const double *force[2]
        const double *motion[2]
        const int *mode[2]

    int lag_use_switching(lag_run *run, const lag_switching_rules *rules)
    lag_instant_report lag_instant_of(lag_run *run)
    lag_contact_report lag_contacts_of(lag_run *run)
    int lag_condition_happened(lag_run *run, int which)
    int lag_condition_holds(const lag_run *run, int which)
    int lag_clock_ticks(lag_run *run, int which)
    double lag_next_tick(const lag_run *run)
    double lag_gap_of_none(const lag_run *run, int row)
    void lag_place(lag_run *run, const double *y)
    void lag_activate(lag_run *run, int row, int active)
    void lag_set_parameters(lag_run *run, const double *parameters)
    int lag_push(lag_run *run, const double *impulse, const double *changes)
    int lag_use_directions(lag_run *run, const lag_directions *directions)
    lag_loss_report lag_loss_of(const lag_run *run, int direction)
    int lag_read_changes(
        lag_run *run, double *of_state, double *of_parameters, double *of_forces)
    const double *lag_change_of_time(const lag_run *run, int condition)
    void lag_set_changes(
        lag_run *run, const double *of_state, const double *of_parameters)
    long lag_take_log(lag_run *run)
    const double *lag_matrix(const lag_run *run)
    int lag_use_pivots(lag_run *run, const lag_pivots *pivots)
    int lag_use_tangent(lag_run *run, const lag_program *tangent, int blocks, int complete)
    int lag_use_explicit_time(lag_run *run, const lag_program *functions)
    int lag_use_breaks(lag_run *run, const double *times, long count)
    int lag_use_functions(lag_run *run, const lag_function *functions, int count)
    int lag_switch(lag_run *run, const lag_method *method)
    int lag_start(lag_run *run)
    int lag_advance(lag_run *run, long slice)
    int lag_sample_until(lag_run *run, double end)
    int lag_sample_here(lag_run *run, double *row)
    long lag_take(lag_run *run)
    void lag_dense(lag_run *run, double t, double *y)
    void lag_limit(lag_run *run, double h_max)
    void lag_move(lag_run *run, double t, const double *y, long times_next)
    int lag_sizes_again(lag_run *run)
    lag_report lag_report_of(const lag_run *run)
    int lag_coefficients(lag_run *run, double *out)


cdef extern from "lagbatch.h" nogil:
    enum: LAG_LANES

    ctypedef struct lag_batch_settings:
        const double *times
        long times_count, max_steps, runs
        const double *parameters
        const double *states
        long slots
        int portable
        int32_t *status
        int64_t *counts
        double *samples

    ctypedef struct lag_batch
    ctypedef struct lag_table

    lag_batch *lag_batch_create(
        const lag_memory *memory, lag_run *single, const lag_program *dynamics,
        const lag_program *constraint, const lag_batch_settings *settings)
    void lag_batch_destroy(lag_batch *batch)
    int lag_batch_advance(lag_batch *batch, long attempts)
    long lag_batch_take(lag_batch *batch, int64_t *runs, int64_t *slots)
    const int64_t *lag_batch_runs(const lag_batch *batch)
    void lag_batch_leave(lag_batch *batch, int lane)
    lag_table *lag_table_create(
        const lag_memory *memory, const lag_program *program, int columns, int np, int portable)
    void lag_table_destroy(lag_table *table)
    void lag_table_evaluate(
        const lag_table *table, const double *parameters, const double *values, long rows,
        long width, double *out)
    void lag_batch_sincos(const double *x, double *sine, double *cosine, int portable)
