/* Checks of streams: known operations, an end, and no place beyond the registers. */
#include "model/check.h"

#include "tape/stream.h"
#include "tape/tape.h"

int lag_check_program(const lag_program *p)
{
    const int64_t registers = p->register_count;
    int valid = p->inputs >= 0 && registers >= 1 && p->inputs <= registers && p->output_count >= 0
                && lag_is_stream(&p->prelude, registers) && lag_is_stream(&p->main, registers)
                && lag_are_registers(p->outputs, p->output_count, registers);
    for (int i = 0; i < 3; ++i)
        valid = valid && (!p->deferred[i].length || lag_is_stream(&p->deferred[i], registers));
    for (int i = 0; i < 2; ++i)
        valid = valid && (!p->output_subsets[i].length || lag_is_stream(&p->output_subsets[i], registers));
    return valid ? LAG_MODEL_READ : LAG_MODEL_PROGRAM;
}

/* Whether n elements from a first one on, `step` apart or listed, all lie in [0, size). */
static int are_in(int64_t first, int64_t step, const int32_t *list, int64_t n, int64_t size)
{
    if (step == LAG_INDEXED)
        return lag_are_registers(list, n, size);
    const int64_t last = first + (n - 1) * step;
    return first >= 0 && first < size && last >= 0 && last < size;
}

/* What an operand of a series operation is. */
enum { NUMBER_OF, NOW, ROW, STORED, NEXT };

/* The operands of each operation, the destination first: a digit is one of the above. */
static const char *operands_of(int op)
{
    switch (op) {
    case SERIES_SUM: return "10101";
    case SERIES_SCALE: return "101";
    case SERIES_RATE: return "11";
    case SERIES_MUL:
    case SERIES_MUL_TAIL:
    case SERIES_INVERSE: return "122";
    case SERIES_MULSUM:
    case SERIES_MUL_TAIL_SUM: return "102201";
    case SERIES_CHAIN: return "1022";
    case SERIES_INTEGRATE: return "41";
    case SERIES_COPY: return "11";
    case SERIES_TO_ROW: return "31";
    default: return NULL;
    }
}

#define LOW_ORDERS 6 /* numbers that are read of a row also at low orders */
#define READ_WITH 3  /* numbers that are read with the last of a row */
#define LEAST 8      /* elements of a vector: two packs */

/* Whether a place of a single series is in the file at all orders. */
static int is_place(const lag_series_program *s, int kind, int64_t place)
{
    const int64_t row = s->order > LOW_ORDERS ? s->order : LOW_ORDERS;
    switch (kind) {
    case NUMBER_OF: return place >= 0 && place < s->size;
    case NOW: return place >= 0 && place + s->origin + (s->order - INT64_C(1)) * s->layer < s->size;
    case NEXT: return place >= 0 && place + s->origin + (int64_t)s->order * s->layer < s->size;
    case ROW: return place >= 1 && place + row <= s->size;
    default: return place >= 0 && place + s->order <= s->size;
    }
}

/* The length of a vector operation after the number of its elements, or 0 if it is invalid. */
static int64_t series_vector_length(const lag_series_program *s, int op, int n, const int32_t *p, int64_t left)
{
    const char *operand = op == SERIES_TO_ROW || op == SERIES_MUL_TAIL_SUM ? NULL : operands_of(op);
    const int64_t last = s->size - s->origin - (s->order - INT64_C(1)) * s->layer;
    int64_t at = 0;
    if (!operand || n < LEAST || n > LAG_SERIES_LONGEST)
        return 0;
    for (int first = 1; *operand; ++operand, first = 0) {
        if (left - at < 2)
            return 0;
        const int kind = *operand - '0', from = p[at], step = p[at + 1];
        at += 2;
        if (step == LAG_INDEXED && ((kind != NOW && kind != NEXT) || left - at < n))
            return 0;
        const int64_t size = kind == NUMBER_OF ? s->size : kind == NEXT ? last - s->layer : last;
        if (!are_in(from, kind == NUMBER_OF ? step != 0 : kind == ROW ? 1 : step, p + at, n, size))
            return 0;
        if (first && step == 0)
            return 0;
        at += step == LAG_INDEXED ? n : 0;
    }
    return at;
}

/* Whether a stream of series operations is valid. */
static int is_series_stream(const lag_series_program *s)
{
    static const int places[] = LAG_SERIES_OPERANDS;
    int64_t at = 0, convolutions = 0;
    while (s->stream.length - at >= 2) {
        const int32_t op = s->stream.code[at], n = s->stream.code[at + 1], *p = s->stream.code + at + 2;
        const int64_t left = s->stream.length - at - 2;
        at += 2;
        if (op == SERIES_END)
            return convolutions <= s->convolutions;
        if (op >= LAG_VECTOR) {
            const int64_t length = series_vector_length(s, op - LAG_VECTOR, n, p, left);
            if (!length)
                return 0;
            at += length;
            continue;
        }
        const char *operand = op == SERIES_COPY || op < 0 ? NULL : operands_of(op);
        const int64_t each = operand ? 1 + places[op] : 0;
        if (!operand || n < 0 || each * n > left)
            return 0;
        for (int64_t i = 0; i < each * n; ++i)
            if (!is_place(s, operand[i % each] - '0', p[i]))
                return 0;
        for (int64_t i = 0; i < each; ++i)
            if (operand[i] - '0' == ROW) {
                convolutions += n;
                break;
            }
        at += each * n;
    }
    return 0;
}

int lag_series_is_valid(const lag_series_program *s, int nq)
{
    const int n = 2 * nq + 2;
    if (s->order < 2 || s->order > LAG_SERIES_ORDER || s->origin < 0 || s->layer < 1 || s->invariant < 0
        || s->numbers < s->invariant || s->size < s->numbers || s->size > INT32_MAX || s->convolutions < 0
        || s->values.output_count < (int64_t)s->numbers + s->begin_count + nq + 1)
        return 0;
    int32_t most = 0;
    for (int i = 0; i < n; ++i) {
        if (s->state[i] < 0)
            return 0;
        most = s->state[i] > most ? s->state[i] : most;
    }
    /* sums follow the last coefficients: of layers as many numbers as the families have, which lie side by side, W last;
     * of rows some that are read with them */
    const int64_t rest = s->layer > 1 ? most + INT64_C(1) - s->state[1] : READ_WITH;
    if (s->origin + (int64_t)s->order * s->layer + most + 1 + rest > s->size)
        return 0;
    if (s->layer > 1)
        for (int i = 1; i < n; ++i)
            if (s->state[i] < s->state[i > nq ? 1 + nq : 1] || s->state[i] > s->state[n - 1])
                return 0;
    return lag_are_registers(s->begins, s->begin_count, s->size) && is_series_stream(s);
}
