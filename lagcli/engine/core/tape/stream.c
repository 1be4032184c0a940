#include "tape/stream.h"

int lag_are_registers(const int32_t *places, int64_t n, int64_t registers)
{
    for (int64_t i = 0; i < n; ++i)
        if (places[i] < 0 || places[i] >= registers)
            return 0;
    return 1;
}

/* The number of words of a vector operation after the number of its elements, or 0 if it is invalid. */
static int64_t vector_length(int op, int n, const int32_t *p, int64_t left, int64_t registers)
{
    int operands = 0;
    switch (op) {
#define OPERANDS(operation, places, value) \
    case operation:                        \
        operands = (places)-1;             \
        break;
        LAG_VECTOR_OPERATIONS(OPERANDS)
#undef OPERANDS
    default:
        return 0;
    }
    if (n < 1 || n > LAG_LONGEST || left < 1 || p[0] < 0 || p[0] > registers - n)
        return 0;
    int64_t at = 1;
    for (int i = 0; i < operands; ++i) {
        if (left - at < 2)
            return 0;
        const int64_t first = p[at], step = p[at + 1], last = first + (n - 1) * step;
        at += 2;
        if (step == LAG_INDEXED) {
            if (left - at < n || !lag_are_registers(p + at, n, registers))
                return 0;
            at += n;
        } else if (first < 0 || first >= registers || last < 0 || last >= registers) {
            return 0;
        }
    }
    return at;
}

int lag_is_stream(const lag_stream *s, int64_t registers)
{
    static const int places[] = LAG_PLACES;
    int64_t at = 0;
    while (s->length - at >= 2) {
        const int32_t op = s->code[at], n = s->code[at + 1];
        const int64_t left = s->length - at - 2;
        const int32_t *p = s->code + at + 2;
        if (op == OP_END)
            return 1;
        if (op < 0 || n < 0)
            return 0;
        if (op >= LAG_VECTOR) {
            const int64_t length = vector_length(op - LAG_VECTOR, n, p, left, registers);
            if (!length)
                return 0;
            at += 2 + length;
        } else {
            if (op > OP_END || (int64_t)places[op] * n > left || !lag_are_registers(p, (int64_t)places[op] * n, registers))
                return 0;
            at += 2 + (int64_t)places[op] * n;
        }
    }
    return 0;
}
