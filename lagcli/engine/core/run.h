/*
 * The compiled engine: steps on the index-1 form, with projection onto the constraints.
 *
 * State y = (q, v, W), W the work done on the system. All memory belongs to the caller.
 */
#ifndef LAGCLI_RUN_H
#define LAGCLI_RUN_H

#include "events.h"
#include "ldl.h"
#include "series.h"
#include "system.h"

#define NEGLIGIBLE 0.01     /* of the tolerance: a projection that moves less leaves f as it is */
#define STIFF 15            /* steps that stability limits, until the model counts as stiff */

typedef struct lag_method lag_method;

typedef struct lag_run {
    const lag_system *system;
    const lag_method *method, *stepped; /* in use; the one that took the last step */
    struct lag_implicit *implicit;     /* what implicit methods need; else NULL */
    lag_series series;                 /* what Taylor's method needs */
    double t_start, t, t_end, h, h_max, rtol, error_old;
    double *atol;                      /* n: the absolute tolerances of the next step; see sizes.h */
    const double *given;               /* n: those that are given; 0 where they follow the size */
    double *size, *gross, *later;      /* n, nq, nq: S, A and R of sizes.h */
    int kinds;                         /* of coordinates, by their unit */
    const int32_t *kind;               /* nq */
    double *largest;                   /* 2 kinds: size of the coordinates and the velocities */
    double h_accepted;                 /* an implicit method's last step; 0 before its first */
    double theta, contraction;         /* Newton's rate, and what follows for its last change */
    double h_converging;               /* the largest step at which Newton is likely to converge */
    int detecting;                     /* whether to look for stiffness */
    int stiff, not_stiff;              /* steps that were so in a row */
    int projecting;
    int watching;                      /* 0: no; 1: for NEAR, taking shorter steps; 2: for OVER too */
    double alpha, beta;                /* Baumgarte; unused where not asked for */
    int baumgarte;
    int alpha_from_step, beta_from_alpha;

    double *y, *f;                     /* state and its derivative, n */
    double t_old, h_old;               /* the last step */
    double *y_old;                     /* n */
    double *stages;                    /* 16 n */
    double *dense;                     /* 7 n */
    int dense_ready;
    double *y_new, *f_new;             /* n: the step's end before projection, its derivative */
    double *trial, *y_sample;          /* n each */
    double *work;                      /* 2 N, 2 n and 3 nc */
    int contradicted;                  /* redundant constraints may contradict each other there */
    int finishing;                     /* the last step is accepted and not yet sampled */

    double *a, *multipliers;           /* nq, nc: at the state evaluated last */

    /* [[M, B'], [B, 0]] by a static elimination ... */
    int eliminating;                   /* 0: not; 1: unrolled in the dynamics tape; 2: by ldl */
    int kept_count;                    /* outputs that tell what the unrolled pivots keep */
    int other_right;                   /* where another right side goes in the unrolled tape */
    int refinable;                     /* whether solutions may be refined before an order is given up */
    int refining;                      /* whether y' asks for a refined solution ... */
    int accurate_steps;                /* ... and the steps in a row that would not have needed it */
    double inaccuracy;                 /* residual of the equations at the last step's end */
    lag_ldl ldl;
    const int32_t *mass_targets;       /* nm: where M's entries go in `factors`; -1: nowhere */
    const int32_t *jacobian_targets;   /* nb */
    double *factors;                   /* inverse of D: 2 (nq + nc); L */
    double *product;                   /* as long as L */
    long dense_steps;                  /* steps to take by the dense one all the same */

    /* ... or dense, bordered by the dependencies of B's rows: N = nq + nc + nc - rank */
    double *kkt, *lu;                  /* N*N each; null until they are needed */
    double *right, *solution;          /* N each */
    int *pivots;                       /* N */
    double *sizes;                     /* nq: changes of the coordinates that count as equal, by their
                                        * inertia at the start; the unknowns are a over sizes */
    double *weight;                    /* nc: brings the rows of B times sizes near one */
    double *lengths;                   /* nc: largest length of each row of B times sizes so far */
    double *plain_lengths;             /* nc: the same of the rows of B alone */
    double *scale_position, *scale_velocity;   /* nh, nc: see project.h */
    double *rows;                      /* nc * nq */
    int *order;                        /* nc */
    double *components;                /* nc * nc */
    double *dependencies;              /* (nc - rank) * nc */
    int rank;                          /* of B at the start */
    double *weakest_rows;              /* nc: the combination of rows that lag_weakest found last */
    double weakest, usual;             /* weakest pivot after the last step; its largest so far */
    double kept, most_kept;            /* the least part that pivots kept of their terms at a stage:
                                        * its smallest and largest during the last step */
    double usually_kept;               /* its largest so far */
    double *jacobian_before;           /* 2 nb: B's entries where a step of Taylor's began and ends */
    double kept_last;                  /* at the last stage; 0 where that was not on the way here */

    const double *times;               /* sample times */
    long times_count, times_next;
    double *block;                     /* rows of samples, as layout.h says */
    long block_rows, block_used;

    lag_events events;

    long steps, rejected, evaluations;
    double t_bad;
    double *y_bad;                     /* n */
} lag_run;

/* Go on with another method from y at t. Returns LAG_RUNNING or LAG_UNDEFINED. */
int lag_switch(lag_run *run, const lag_method *method);

/* Prepare the first step from y at t. Returns LAG_RUNNING or what is wrong there. */
int lag_start(lag_run *run);

/* Take at most `slice` steps. */
int lag_advance(lag_run *run, long slice);

/* Method i of those there are, or NULL; and its name. */
const lag_method *lag_method_at(int i);
const char *lag_method_name(const lag_method *method);

#endif
