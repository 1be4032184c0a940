/* The consistent initial state of a model as data, for other parameters and initial values than those of the data. */
#ifndef LAGCLI_START_H
#define LAGCLI_START_H

#include "lagmodel.h"
#include "memory.h"
#include "tape/tape.h"

/* Why there is none. */
enum lag_start_status {
    LAG_START_FOUND,
    LAG_START_CONTRADICTED, /* no values of the free entries satisfy the constraints nearby */
    LAG_START_UNDEFINED,    /* the constraints have no finite value */
    LAG_START_SINGULAR,     /* the rank of B is not that of the data */
};

/* The largest of n outputs of a tape from `first` on over their scales, those from `scale` on; INFINITY where one is
 * not finite. */
double lag_largest_residual(const lag_tape *tape, int n, int first, int scale);

/* The search: its tape and its scratch. */
typedef struct {
    const lag_model *model;
    lag_tape constraint;
    double *rows, *right, *lengths, *x, *tried; /* nc * nq, nc, nc, nq, nq */
    double *own, *least;               /* nc, nc: see residual_at */
} lag_start_search;

/* Prepare it. Returns 0, or 1 where there is no memory. */
int lag_start_bind(lag_pool *pool, lag_start_search *search, const lag_model *model);

/*
 * Change the entries of y = (q, v, W) that are not `fixed` (2 nq) until phi = 0 and psi = 0, each Newton step by the
 * least change in terms of the sizes of the coordinates; and measure the rows of B there, to `lengths` and
 * `plain_lengths` (nc). `p` are the parameters, np of them. Returns a lag_start_status.
 */
int lag_start_find(lag_start_search *search, double t, const double *p, const int *fixed, double *y,
                   double *lengths, double *plain_lengths);

#endif
