/* The tape evaluator. The streams are those of engine/program/program.py, the operations those of
 * engine/tape/tape.py and after them the ones that only programs have. */
#ifndef LAGCLI_TAPE_H
#define LAGCLI_TAPE_H

#include <stdint.h>

enum lag_op {
    OP_ADD, OP_SUB, OP_MUL, OP_DIV, OP_NEG, OP_POW, OP_SQRT, OP_SIN, OP_COS, OP_TAN,
    OP_ASIN, OP_ACOS, OP_ATAN, OP_ATAN2, OP_SINH, OP_COSH, OP_TANH, OP_ASINH, OP_ACOSH,
    OP_ATANH, OP_EXP, OP_LOG, OP_ERF, OP_ERFC, OP_FLOOR, OP_CEIL, OP_ABS, OP_LT, OP_LE,
    OP_EQ, OP_NE, OP_AND, OP_OR, OP_NOT, OP_SELECT,
    OP_MULADD, OP_MULSUB, OP_SUBMUL, OP_SINCOS, OP_END, OP_MOVE
};

#define LAG_VECTOR 64       /* added to an operation of a stream, it is one on vectors */
#define LAG_INDEXED INT32_MIN /* the step of an operand whose places are listed */
#define LAG_LONGEST 256     /* elements that a vector has at most */

/* A tape bound to its register file; inputs come first. The later streams are for outputs that are
 * asked for apart; those alone for outputs without the rest, NULL where the tape has none. */
typedef struct {
    const int32_t *stream, *later[3], *alone[2];
    int32_t *held;                     /* what was evaluated last: all (0), or which alone; and, of the
                                        * dynamics, a lag_factored of its matrix */
    double *registers;
    const int32_t *outputs;
} lag_tape;

/* Run a stream on a register file. */
void lag_stream_run(const int32_t *stream, double *registers);

/* Read output i of a tape. */
#define OUT(tape, i) ((tape)->registers[(tape)->outputs[i]])

#endif
