/* A simulation of a model as data: what it has, beside its run. */
#ifndef LAGCLI_SIMULATION_H
#define LAGCLI_SIMULATION_H

#include "archive.h"
#include "lagmodel.h"
#include "lagstart.h"
#include "memory.h"
#include "run.h"
#include "tape/tape.h"

/* The log: it grows, and is cut back where a simulation is restored. */
typedef struct {
    lag_pool pool;
    double *rows;
    int64_t capacity;
} lag_event_log;

/* What follows: the start; steps; the instant at which an event has ended the motion; its sample. */
enum lag_phase { LAG_AT_START, LAG_UNDER_WAY, LAG_SETTLING, LAG_LAST_SAMPLE, LAG_ENDED };

/* What events that set values need: for lag_adjust, if there is anything that holds. */
typedef struct {
    lag_adjustment *adjustment;        /* NULL: nothing holds */
    int *fixed;                        /* 2 nq: the values that events have set at this instant */
    int *positions, *velocities, *sign; /* nc of all: see lag_held_rows */
    double *no_gap, *impulse;          /* nc of all */
    double *reaction;                  /* nc of the run */
    double *p;                         /* parameters without branches */
} lag_displacement;

struct lag_simulation {
    lag_pool pool;
    lag_model model;
    lag_run *run;
    enum lag_phase phase;
    int status;                        /* its last, once it has ended */
    int64_t steps_to_unroll;           /* steps after which the unrolled elimination is used */
    int method;                        /* its number */
    int orders;                        /* of pivots that have been requested */
    double retried;                    /* time at which a solution was last replaced by the dense one ... */
    int retries;                       /* ... how often there */
    int repeats;                       /* of the last step, which may have gone over a singular configuration */
    int64_t answered;                  /* statuses that the caller answers: lag_let_answer */

    /* actions.c: events */
    int64_t *happened;                 /* how often each has */
    lag_tape actions, energy;
    double *p, *held;                  /* parameters that events set; with branches and pieces of functions */
    double *none;                      /* nq + nc zeros */
    double *before, *after;            /* 2 nq + 1: scratch */
    lag_displacement displacement;
    int stopped;                       /* the event that has ended it; -1 */
    lag_event_log *log;
    int width;                         /* of its entries */
    int64_t used;                      /* entries */
    int64_t seen;                      /* entries of rows that events have reacted to */
    int open;                          /* whether an instant waits for its end ... */
    int64_t first;                     /* ... the first entry at it */
    int64_t engaging;                  /* the entry of an event that engages a row, whose velocities change; -1 */
    double engaged_work, work_before;  /* the entry's work, and W, then */
};

/* The state of a simulation between steps, as archive.h says: without the log of events. */
void lag_archive_simulation(lag_archive *archive, lag_simulation *s);

/* Events: what has happened, and the entries to which none has reacted. */
void lag_archive_events(lag_archive *archive, lag_simulation *s);

/* Allocate what events need. Returns 0, or 1 where there is no memory. */
int lag_events_bind(lag_simulation *s);

/* The parameters with the branches, and the pieces of functions, now; where rows switch. */
const double *lag_held_parameters(lag_simulation *s);

/* The parameters of programs now, np of them: where events set some, their values. */
const double *lag_parameters_of(lag_simulation *s);

/* Give the first parameters other values where these differ from others: events may have set the rest. The motion continues from
 * its state; what switches is an instant there, which lag_simulate completes. Returns LAG_RUNNING, or why it ends. */
int lag_change_parameters(lag_simulation *s, const double *from, const double *to, int count);

/* Let it return LAG_RUNNING before each instant at which something switches, which lag_simulate completes; or not. */
void lag_wait(lag_simulation *s, int waits);

/* Whether it waits before an instant. */
int lag_is_due(const lag_simulation *s);

/* The time of the next tick of a clock; infinity if there is none. */
double lag_next_time(const lag_simulation *s);

/* lag_simulate_to, with a function that is called after each step, and returns the time not to go beyond; it ends before
 * an instant if it waits. */
typedef double lag_after_step(void *context);
int lag_simulate_watched(lag_simulation *s, double t, lag_after_step *after, void *context);

/* Whether a contact is beyond its surface at a state, once the motion has begun: it begins on the surfaces of contacts
 * that are closed or beyond them. */
int lag_is_violated(const lag_simulation *s, const double *y);

/* Append the entries of the run's log. Returns 0, or 1 where there is no memory. */
int lag_events_collect(lag_simulation *s);

/* Perform the actions of the events that have happened. Returns LAG_RUNNING, or why the motion ends. */
int lag_events_happen(lag_simulation *s);

/* Complete the entries of a finished instant. */
void lag_events_resolve(lag_simulation *s);

#endif
