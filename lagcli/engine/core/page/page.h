/*
 * A model that is simulated in a page, by WebAssembly: an instance as FMUs have it, whose runs are sampled. JavaScript
 * calls these functions; integers have 32 bits, and places are addresses in the module's memory, which may grow with
 * any call.
 *
 * A sample is t, q, v, a, lambda, the derived values, and W, the work done on the system.
 */
#ifndef LAGCLI_PAGE_H
#define LAGCLI_PAGE_H

#include <stdint.h>

typedef struct lag_page lag_page;

/* Whether a run continues, is over, or has failed. */
enum lag_page_status { LAG_PAGE_UNDER_WAY, LAG_PAGE_DONE, LAG_PAGE_FAILED };

/* The numbers of a model: coordinates, constraints, derived values, those of a sample, parameters. */
enum lag_page_count { LAG_PAGE_COORDINATES, LAG_PAGE_CONSTRAINTS, LAG_PAGE_DERIVED, LAG_PAGE_WIDTH, LAG_PAGE_PARAMETERS };

/* Memory for what is handed over; NULL if there is none. */
void *lag_page_allocate(int32_t bytes);
void lag_page_release(void *memory);

/* Make it of the contents of model.bin and values.bin, which must live as long as it. NULL, and a message, if that fails. */
lag_page *lag_page_open(const void *model, int32_t model_bytes, const void *values, int32_t values_bytes);
int32_t lag_page_count(const lag_page *page, int32_t which);

/* The last message; what is read of a run is valid until the next call of another function than these. */
const char *lag_page_message(void);

/* Forget what was set. */
void lag_page_reset(lag_page *page);

/* Set a parameter, or an initial value of q and v: by its number among all parameters, or 2 nq values. A guess may be
 * changed. Returns 0, or 1, and a message. */
int32_t lag_page_set_parameter(lag_page *page, int32_t number, double value);
int32_t lag_page_set_initial(lag_page *page, int32_t number, double value, int32_t guess);

/* Find the consistent initial state and begin a run: `count` sample times; a relative tolerance, 0 for that of the
 * model. Returns 0, or 1, and a message. */
int32_t lag_page_begin(lag_page *page, const double *times, int32_t count, double t_end, double rtol);

/* Take about so many steps. Returns a lag_page_status; with LAG_PAGE_FAILED, a message. */
int32_t lag_page_go_on(lag_page *page, int32_t steps);

/* The initial value of q or v before the search for a consistent state: what was set, or follows from parameters. */
double lag_page_given(const lag_page *page, int32_t number);

/* The samples so far; the parameters and the state (q, v) at the start; the number of steps. */
int32_t lag_page_samples(const lag_page *page);
const double *lag_page_sample_values(const lag_page *page);
const double *lag_page_start_parameters(const lag_page *page);
const double *lag_page_start_state(const lag_page *page);
int32_t lag_page_steps(const lag_page *page);

/* The log so far: see lag_log_of; and the event that has ended the run, or -1. */
int32_t lag_page_log_count(const lag_page *page);
int32_t lag_page_log_width(const lag_page *page);
const double *lag_page_log(const lag_page *page);
int32_t lag_page_stopped_by(const lag_page *page);

#endif
