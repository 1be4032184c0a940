#include "tape.h"

#include <math.h>

void lag_tape_run(const lag_tape *tape)
{
    double *r = tape->registers;
    const lag_step *end = tape->steps + tape->length;
    for (const lag_step *s = tape->steps; s != end; ++s) {
        const double a = r[s->a];
        double x;
        switch (s->op) {
        case OP_ADD: x = a + r[s->b]; break;
        case OP_SUB: x = a - r[s->b]; break;
        case OP_MUL: x = a * r[s->b]; break;
        case OP_DIV: x = a / r[s->b]; break;
        case OP_NEG: x = -a; break;
        case OP_POW: x = pow(a, r[s->b]); break;
        case OP_SQRT: x = sqrt(a); break;
        case OP_SIN: x = sin(a); break;
        case OP_COS: x = cos(a); break;
        case OP_TAN: x = tan(a); break;
        case OP_ASIN: x = asin(a); break;
        case OP_ACOS: x = acos(a); break;
        case OP_ATAN: x = atan(a); break;
        case OP_ATAN2: x = atan2(a, r[s->b]); break;
        case OP_SINH: x = sinh(a); break;
        case OP_COSH: x = cosh(a); break;
        case OP_TANH: x = tanh(a); break;
        case OP_ASINH: x = asinh(a); break;
        case OP_ACOSH: x = acosh(a); break;
        case OP_ATANH: x = atanh(a); break;
        case OP_EXP: x = exp(a); break;
        case OP_LOG: x = log(a); break;
        case OP_ERF: x = erf(a); break;
        case OP_ERFC: x = erfc(a); break;
        case OP_FLOOR: x = floor(a); break;
        case OP_CEIL: x = ceil(a); break;
        case OP_ABS: x = fabs(a); break;
        case OP_LT: x = a < r[s->b]; break;
        case OP_LE: x = a <= r[s->b]; break;
        case OP_EQ: x = a == r[s->b]; break;
        case OP_NE: x = a != r[s->b]; break;
        case OP_AND: x = a * r[s->b]; break;
        case OP_OR: x = fmax(a, r[s->b]); break;
        case OP_NOT: x = 1.0 - a; break;
        default: x = a != 0.0 ? r[s->b] : r[s->c]; break; /* OP_SELECT */
        }
        r[s->to] = x;
    }
}
