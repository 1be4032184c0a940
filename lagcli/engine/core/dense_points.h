/* Control points of the last step's dense output, a polynomial on 0 to 1 (polynomial.h), and of its derivatives. */
#ifndef LAGCLI_DENSE_POINTS_H
#define LAGCLI_DENSE_POINTS_H

typedef struct {
    int count;                         /* of states */
    const int *state;                  /* count: their indices in y */
    int *ready;                        /* count: orders of derivatives whose control points are known */
    int degree;
    double *points;                    /* of each state: control points, and those of the derivatives over factorials */
} lag_dense_points;

#endif
