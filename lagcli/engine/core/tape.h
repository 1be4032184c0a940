/* The tape evaluator: operations on a register file. The operations are those of engine/tape.py. */
#ifndef LAGCLI_TAPE_H
#define LAGCLI_TAPE_H

#include <stdint.h>

enum lag_op {
    OP_ADD, OP_SUB, OP_MUL, OP_DIV, OP_NEG, OP_POW, OP_SQRT, OP_SIN, OP_COS, OP_TAN,
    OP_ASIN, OP_ACOS, OP_ATAN, OP_ATAN2, OP_SINH, OP_COSH, OP_TANH, OP_ASINH, OP_ACOSH,
    OP_ATANH, OP_EXP, OP_LOG, OP_ERF, OP_ERFC, OP_FLOOR, OP_CEIL, OP_ABS, OP_LT, OP_LE,
    OP_EQ, OP_NE, OP_AND, OP_OR, OP_NOT, OP_SELECT
};

/* One operation: r[to] = op(r[a], r[b], r[c]). */
typedef struct {
    int32_t op, to, a, b, c;
} lag_step;

/* A tape bound to its register file; the state's registers come first. */
typedef struct {
    const lag_step *steps;
    int length;
    double *registers;
    const int32_t *outputs;
} lag_tape;

void lag_tape_run(const lag_tape *tape);

/* Read output i of a tape. */
#define OUT(tape, i) ((tape)->registers[(tape)->outputs[i]])

#endif
