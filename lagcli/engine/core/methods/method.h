/* Interface of integration methods. Each has one constant table, in its own file. */
#ifndef LAGCLI_METHOD_H
#define LAGCLI_METHOD_H

#include "run.h"

struct lag_method {
    const char *name;
    double order;          /* of its error control, used to choose the first step */
    int uses_slope;        /* steps begin with run->step.f, the slope at y, and store that of their end in f_new */
    int uses_series;       /* steps are power series: too long for a cubic, and without refined solutions */

    /* Take one accepted step from (t, y) to (t + h, y_new). Returns LAG_RUNNING, LAG_UNDEFINED,
     * LAG_FLOOR or, of implicit methods, LAG_ORDER. */
    int (*step)(lag_run *run);

    /* The last step's dense output, n values. */
    void (*dense)(lag_run *run, double t, double *y);

    /* The same with different rounding, for frequent evaluation in one step. NULL: as above. */
    void (*dense_often)(lag_run *run, double t, double *y);

    /* y' of the dense output, n values; and y at a time in the last step by a step of that length, which takes the place
     * of the stages: returns 0, or 1 where it is undefined. NULL if the dense output needs no check. */
    void (*dense_slope)(lag_run *run, double t, double *slope);
    int (*step_to)(lag_run *run, double t, double *y);

    /* The control points of component i of the dense output, a polynomial on 0 to 1 (polynomial.h), to b, which has
     * LAG_MOST_DEGREE + 1 numbers. Returns its degree. */
    int (*control_points)(lag_run *run, int i, double *b);

    /* Discard the last step: the next one does not continue it. NULL if nothing is stored. */
    void (*restart)(lag_run *run);
};

/* All methods; runs begin with the first. */
#define LAG_METHODS(X) X(lag_dop853) X(lag_rodas5p) X(lag_radau5) X(lag_taylor)

#define DECLARE(method) extern const lag_method method;
LAG_METHODS(DECLARE)
#undef DECLARE

#endif
