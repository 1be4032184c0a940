#include "native/emit.h"

#include <string.h>

#include "native/registers.h"

/* Numbers in the frame, each four times. */
enum { SIGN, MAGNITUDE, ONE, CLIPPED, CONSTANTS };

/* Arguments that are addresses, and what a caller reserves for them. */
#if defined(_WIN32)
enum { FIRST = X86_RCX, SECOND = X86_RDX, THIRD = X86_R8, AFTER_NUMBER = X86_RDX, AFTER_BOTH = X86_R8, SHADOW = 32, SAVED = 10 };
#else
enum { FIRST = X86_RDI, SECOND = X86_RSI, THIRD = X86_RDX, AFTER_NUMBER = X86_RDI, AFTER_BOTH = X86_RSI, SHADOW = 0, SAVED = 0 };
#endif

#define MOST_BYTES 640 /* of an operation's code; of a vector, for every four elements of it */

typedef struct {
    lag_registers r;
    lag_pool *pool;
    const lag_calls *calls;
    uint8_t *start, *end;
    int wide;                          /* whether all is done on four numbers */
    int upper;                         /* whether the upper halves of registers are in use */
    int unknown;                       /* whether there are no instructions for an operation */
} emitter;

void lag_fill_frame(double *frame)
{
    const uint64_t sign = (uint64_t)1 << 63, magnitude = ~sign;
    for (int k = 0; k < 4; ++k) {
        memcpy(frame + 4 * SIGN + k, &sign, sizeof sign);
        memcpy(frame + 4 * MAGNITUDE + k, &magnitude, sizeof magnitude);
        frame[4 * ONE + k] = 1.0;
        frame[4 * CLIPPED + k] = LAG_CLIPPED;
    }
}

static lag_operand constant(int which)
{
    return lag_at_slot(4 * which);
}

/* Make room for an operation's code. Returns 0, or 1 where there is no memory. */
static int reserve(emitter *e, size_t bytes)
{
    const size_t used = (size_t)(e->r.code.at - e->start), all = (size_t)(e->end - e->start);
    if (all - used >= bytes)
        return 0;
    uint8_t *more = lag_get(e->pool, 2 * all + bytes, 1);
    if (!more)
        return 1;
    if (used)
        memcpy(more, e->start, used);
    e->start = more;
    e->end = more + 2 * all + bytes;
    e->r.code.at = more + used;
    return 0;
}

static void put(emitter *e, lag_instruction i, int to, int from, lag_operand of)
{
    x86_vex(&e->r.code, i, e->wide, to, from, of);
}

static void put_immediate(emitter *e, lag_instruction i, int to, int from, lag_operand of, int immediate)
{
    put(e, i, to, from, of);
    x86_byte(&e->r.code, immediate);
}

static lag_operand reg(int number)
{
    return x86_register(number);
}

/* Tell the registers which operands have been read. */
static void used(emitter *e, const lag_node *x)
{
    for (int j = 0; j < 3; ++j)
        if (x->operand[j] != LAG_NO_VALUE)
            lag_used(&e->r, x->operand[j], x->later[j]);
}

static void defined(emitter *e, const lag_node *x, int to)
{
    lag_defined(&e->r, x->result[0], to, x->first[0]);
}

/* a (instruction) b, to a register that may be one of theirs. */
static void binary(emitter *e, const lag_node *x, lag_instruction i, int commutes)
{
    unsigned pinned = 0;
    const int swapped = commutes && e->r.in[x->operand[0]] < 0 && e->r.in[x->operand[1]] >= 0;
    const int a = lag_in_register(&e->r, x->operand[swapped], &pinned);
    const lag_operand b = lag_as_operand(&e->r, x->operand[!swapped], x->later[!swapped], &pinned);
    used(e, x);
    const int to = lag_take_register(&e->r, 0);
    put(e, i, to, a, b);
    defined(e, x, to);
}

/* One operand, combined with a constant. */
static void masked(emitter *e, const lag_node *x, lag_instruction i, int which)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned);
    used(e, x);
    const int to = lag_take_register(&e->r, 0);
    put(e, i, to, a, constant(which));
    defined(e, x, to);
}

/* A product, then its sum with c or a difference. */
static void product(emitter *e, const lag_node *x)
{
    unsigned pinned = 0;
    const int32_t c = x->operand[2];
    const int swapped = e->r.in[x->operand[0]] < 0 && e->r.in[x->operand[1]] >= 0;
    int other = 0;
    if (x->op == OP_SUBMUL)
        other = lag_in_register(&e->r, c, &pinned);
    else if (e->r.in[c] >= 0)
        pinned |= 1u << e->r.in[c];
    const int a = lag_in_register(&e->r, x->operand[swapped], &pinned);
    const lag_operand b = lag_as_operand(&e->r, x->operand[!swapped], x->later[!swapped], &pinned);
    for (int j = 0; j < 2; ++j) /* c is still to be read */
        if (x->operand[j] != c)
            lag_used(&e->r, x->operand[j], x->later[j]);
    const int to = lag_take_register(&e->r, e->r.in[c] >= 0 ? 1u << e->r.in[c] : 0);
    put(e, X86_MUL, to, a, b);
    if (x->op == OP_SUBMUL) {
        put(e, X86_SUB, to, other, reg(to));
    } else {
        pinned = 1u << to;
        put(e, x->op == OP_MULADD ? X86_ADD : X86_SUB, to, to, lag_as_operand(&e->r, c, x->later[2], &pinned));
    }
    lag_used(&e->r, c, x->later[2]);
    defined(e, x, to);
}

static void unary(emitter *e, const lag_node *x)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned);
    used(e, x);
    const int to = lag_take_register(&e->r, 0);
    if (x->op == OP_SQRT)
        put(e, X86_SQRT, to, e->wide ? 0 : a, reg(a)); /* of one number, the rest of the register */
    else if (x->op != OP_MOVE)
        e->unknown = 1;
    else if (to != a)
        put(e, X86_COPY, to, 0, reg(a));
    defined(e, x, to);
}

static void relation(emitter *e, const lag_node *x, int which)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned);
    const lag_operand b = lag_as_operand(&e->r, x->operand[1], x->later[1], &pinned);
    used(e, x);
    const int to = lag_take_register(&e->r, 0);
    put_immediate(e, X86_COMPARE, to, a, b, which);
    put(e, X86_AND, to, to, constant(ONE));
    defined(e, x, to);
}

/* 1 - a */
static void negation(emitter *e, const lag_node *x)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned), to = lag_take_register(&e->r, pinned);
    put(e, X86_LOAD, to, 0, constant(ONE));
    put(e, X86_SUB, to, to, reg(a));
    used(e, x);
    defined(e, x, to);
}

/* b where a is not zero, else c. */
static void choice(emitter *e, const lag_node *x)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned);
    const int b = lag_in_register(&e->r, x->operand[1], &pinned);
    const int c = lag_in_register(&e->r, x->operand[2], &pinned), to = lag_take_register(&e->r, pinned);
    put(e, X86_XOR, to, to, reg(to));
    put_immediate(e, X86_COMPARE, to, a, reg(to), X86_NE);
    put_immediate(e, X86_CHOOSE, to, c, reg(b), to << 4);
    used(e, x);
    defined(e, x, to);
}

/* a - a where a is below zero by rounding alone, for numbers of the size of b's root; else a. */
static void clip(emitter *e, const lag_node *x)
{
    unsigned pinned = 0;
    const int a = lag_in_register(&e->r, x->operand[0], &pinned);
    const int b = lag_in_register(&e->r, x->operand[1], &pinned);
    const int square = lag_take_register(&e->r, pinned), bound = lag_take_register(&e->r, pinned | 1u << square);
    put(e, X86_MUL, square, a, reg(a));
    put(e, X86_MUL, bound, b, constant(CLIPPED));
    put_immediate(e, X86_COMPARE, square, square, reg(bound), X86_LE);
    put(e, X86_XOR, bound, bound, reg(bound));
    put_immediate(e, X86_COMPARE, bound, a, reg(bound), X86_LT);
    put(e, X86_AND, square, square, reg(bound));
    put(e, X86_SUB, bound, a, reg(a));
    put_immediate(e, X86_CHOOSE, square, a, reg(bound), square << 4);
    used(e, x);
    defined(e, x, square);
}

static void narrow(emitter *e)
{
    if (e->upper || e->wide)
        x86_narrow(&e->r.code);
    e->upper = 0;
}

static lag_operand present(const emitter *e, int32_t value)
{
    return e->r.in[value] >= 0 ? reg(e->r.in[value]) : lag_at_home(&e->r, value);
}

static void move(emitter *e, int to, lag_operand from)
{
    if (from.base || from.reg != to)
        put(e, from.base ? X86_LOAD : X86_COPY, to, 0, from);
}

/* Put one or two numbers in the first registers. */
static void number_arguments(emitter *e, const lag_node *x)
{
    lag_operand first = present(e, x->operand[0]);
    if (x->operand[1] == LAG_NO_VALUE) {
        move(e, 0, first);
        return;
    }
    const lag_operand second = present(e, x->operand[1]);
    if (second.base || second.reg != 0) {
        move(e, 0, first);
        move(e, 1, second);
        return;
    }
    if (!first.base && first.reg == 1) { /* they change places */
        move(e, 2, first);
        first = reg(2);
    }
    move(e, 1, second);
    move(e, 0, first);
}

static void call(emitter *e, const lag_node *x, lag_called *function)
{
    lag_registers *r = &e->r;
    const int both = x->op == OP_SINCOS;
    for (int j = 0; j < 2; ++j) /* what is not used later need not be saved */
        if (x->operand[j] != LAG_NO_VALUE && !e->wide)
            r->next[x->operand[j]] = x->later[j];
    lag_save_all(r);
    narrow(e);
    if (e->wide) {
        x86_address(&r->code, FIRST, lag_at_home(r, x->operand[0]));
        if (!both)
            x86_address(&r->code, SECOND, lag_at_home(r, x->operand[x->operand[1] != LAG_NO_VALUE]));
    } else {
        number_arguments(e, x);
    }
    lag_forget_all(r);
    if (both) {
        const lag_operand sine = lag_defined_in_memory(r, x->result[0], x->first[0]);
        const lag_operand cosine = lag_defined_in_memory(r, x->result[1], x->first[1]);
        x86_address(&r->code, e->wide ? SECOND : AFTER_NUMBER, sine);
        x86_address(&r->code, e->wide ? THIRD : AFTER_BOTH, cosine);
    } else if (e->wide) {
        x86_address(&r->code, THIRD, lag_defined_in_memory(r, x->result[0], x->first[0]));
    }
    x86_call(&r->code, (uint64_t)(uintptr_t)function);
    used(e, x);
    if (!e->wide && !both)
        defined(e, x, 0);
}

/* A vector's operand: a register with one number for all, or where elements are. */
typedef struct {
    int broadcast;
    const int32_t *words;
} vector_operand;

static int is_contiguous(const int32_t *words, int32_t first, int count)
{
    for (int k = 1; k < count; ++k)
        if (lag_element(words, first + k) != lag_element(words, first) + k)
            return 0;
    return 1;
}

/* Four elements of an operand from the k-th on, or one, in memory or in `to`; `spare` is overwritten. */
static lag_operand elements(emitter *e, const vector_operand *x, int k, int four, int to, int spare)
{
    lag_x86 *code = &e->r.code;
    if (x->broadcast >= 0)
        return reg(x->broadcast);
    if (!four || is_contiguous(x->words, k, 4))
        return lag_at_place(lag_element(x->words, k));
    for (int half = 0; half < 2; ++half) {
        const int pair = half ? spare : to;
        x86_vex(code, X86_LOAD, 0, pair, 0, lag_at_place(lag_element(x->words, k + 2 * half)));
        x86_vex(code, X86_LOAD_HIGH, 0, pair, pair, lag_at_place(lag_element(x->words, k + 2 * half + 1)));
    }
    x86_vex(code, X86_INSERT, 1, to, to, reg(spare));
    x86_byte(code, 1);
    return reg(to);
}

/* An operand in a register: itself, or loaded to `to`. */
static int loaded(emitter *e, lag_operand x, int four, int to)
{
    if (!x.base)
        return x.reg;
    x86_vex(&e->r.code, X86_LOAD, four, to, 0, x);
    return to;
}

/* Four elements, or one, of the result in `to`. */
static int vector_value(emitter *e, int op, int four, const lag_operand *x, const int *own)
{
    lag_x86 *code = &e->r.code;
    const int to = own[3];
    switch (op) {
    case OP_ADD:
    case OP_SUB:
    case OP_MUL:
    case OP_DIV: {
        const lag_instruction i = op == OP_ADD ? X86_ADD : op == OP_SUB ? X86_SUB : op == OP_MUL ? X86_MUL : X86_DIV;
        x86_vex(code, i, four, to, loaded(e, x[0], four, own[0]), x[1]);
        return to;
    }
    case OP_NEG:
        x86_vex(code, X86_XOR, four, to, loaded(e, x[0], four, own[0]), constant(SIGN));
        return to;
    case OP_ABS:
        x86_vex(code, X86_AND, four, to, loaded(e, x[0], four, own[0]), constant(MAGNITUDE));
        return to;
    case OP_SQRT: {
        const int a = loaded(e, x[0], four, own[0]);
        x86_vex(code, X86_SQRT, four, to, four ? 0 : a, reg(a));
        return to;
    }
    case OP_MULADD:
    case OP_MULSUB:
        x86_vex(code, X86_MUL, four, to, loaded(e, x[0], four, own[0]), x[1]);
        x86_vex(code, op == OP_MULADD ? X86_ADD : X86_SUB, four, to, to, x[2]);
        return to;
    case OP_SUBMUL:
        x86_vex(code, X86_MUL, four, to, loaded(e, x[0], four, own[0]), x[1]);
        x86_vex(code, X86_SUB, four, to, loaded(e, x[2], four, own[2]), reg(to));
        return to;
    case OP_MOVE:
        return loaded(e, x[0], four, own[0]);
    default:
        e->unknown = 1;
        return to;
    }
}

#define WORTH_A_LOOP 32 /* elements */

static void vector(emitter *e, const lag_node *x)
{
    lag_registers *r = &e->r;
    const int op = x->op - LAG_VECTOR, n = x->length;
    const int32_t out = x->words[0], *words = x->words + 1;
    static const int places_of[] = LAG_PLACES;
    const int count = places_of[op] - 1;
    vector_operand given[3];
    unsigned pinned = 0;
    int own[9], side_by_side = 1, k = 0;
    lag_end_segment(r);
    for (int j = 0; j < count; ++j, words = lag_after(words, n)) {
        given[j] = (vector_operand){-1, words};
        if (x->operand[j] == LAG_NO_VALUE) {
            side_by_side &= words[1] == 1;
            continue;
        }
        const int32_t value = x->operand[j];
        const lag_operand from = present(e, value);
        if (!from.base)
            pinned |= 1u << from.reg;
        given[j].broadcast = lag_take_register(r, pinned);
        pinned |= 1u << given[j].broadcast;
        x86_vex(&r->code, X86_BROADCAST, 1, given[j].broadcast, 0, from);
    }
    for (int j = 0; j < 9; ++j) {
        own[j] = lag_take_register(r, pinned);
        pinned |= 1u << own[j];
    }
    if (side_by_side && n >= WORTH_A_LOOP) {
        lag_operand of[3] = {{0}, {0}, {0}}, to = lag_at_place(out);
        k = n / 4 * 4;
        x86_set_index(&r->code, -8 * k);
        const uint8_t *start = r->code.at;
        for (int j = 0; j < count; ++j) {
            of[j] = given[j].broadcast >= 0 ? reg(given[j].broadcast) : lag_at_place(given[j].words[0] + k);
            of[j].indexed = of[j].base != 0;
        }
        const int made = vector_value(e, op, 1, of, own);
        to.bytes += 8 * k;
        to.indexed = 1;
        x86_vex(&r->code, X86_STORE, 1, made, 0, to);
        x86_add(&r->code, X86_RAX, 32);
        x86_loop(&r->code, start);
    }
    for (int turn = 0; k < n; ++turn) {
        const int four = k + 4 <= n;
        const int *at = own + 4 * (turn & 1);
        lag_operand of[3];
        for (int j = 0; j < count; ++j)
            of[j] = elements(e, given + j, k, four, at[j], own[8]);
        x86_vex(&r->code, X86_STORE, four, vector_value(e, op, four, of, at), 0, lag_at_place(out + k));
        k += four ? 4 : 1;
    }
    for (int j = 0; j < n; ++j)
        r->saved[x->result[0] + j] = 1;
    used(e, x);
    e->upper = 1;
}

static void operation(emitter *e, const lag_node *x)
{
    if (x->op >= LAG_VECTOR) {
        vector(e, x);
        return;
    }
    if (e->calls->of[x->op]) {
        call(e, x, e->calls->of[x->op]);
        return;
    }
    switch (x->op) {
    case OP_ADD:
        binary(e, x, X86_ADD, 1);
        break;
    case OP_MUL:
    case OP_AND:
        binary(e, x, X86_MUL, 1);
        break;
    case OP_SUB:
        binary(e, x, X86_SUB, 0);
        break;
    case OP_DIV:
        binary(e, x, X86_DIV, 0);
        break;
    case OP_OR:
        binary(e, x, X86_MAX, 0);
        break;
    case OP_MULADD:
    case OP_MULSUB:
    case OP_SUBMUL:
        product(e, x);
        break;
    case OP_NEG:
        masked(e, x, X86_XOR, SIGN);
        break;
    case OP_ABS:
        masked(e, x, X86_AND, MAGNITUDE);
        break;
    case OP_LT:
        relation(e, x, X86_LT);
        break;
    case OP_LE:
        relation(e, x, X86_LE);
        break;
    case OP_EQ:
        relation(e, x, X86_EQ);
        break;
    case OP_NE:
        relation(e, x, X86_NE);
        break;
    case OP_NOT:
        negation(e, x);
        break;
    case OP_SELECT:
        choice(e, x);
        break;
    case OP_CLIP:
        clip(e, x);
        break;
    default:
        unary(e, x);
    }
}

/* Windows' functions keep the values of registers from the sixth on. */
static void saved_registers(emitter *e, lag_instruction i)
{
    for (int k = 0; k < SAVED; ++k) {
        const lag_operand at = {.base = X86_RBP, .bytes = (4 * CONSTANTS + 2 * k) * 8 - LAG_BIAS};
        x86_vex(&e->r.code, (lag_instruction){i.opcode, 1, X86_66, X86_66}, 0, 6 + k, 0, at);
    }
}

lag_code lag_emit(const lag_flow *flow, lag_pool *pool, int wide, const lag_calls *calls)
{
    emitter e = {.pool = pool, .calls = calls, .wide = wide};
    lag_x86 *code = &e.r.code;
    if (lag_registers_begin(&e.r, pool, flow, wide, 4 * CONSTANTS + 2 * SAVED) || reserve(&e, 4 * MOST_BYTES))
        return (lag_code){0};
    x86_push(code, X86_RBX);
    x86_push(code, X86_RBP);
    x86_add(code, X86_RSP, -8 - SHADOW);
    x86_sum(code, X86_RBX, FIRST, LAG_BIAS);
    x86_sum(code, X86_RBP, SECOND, LAG_BIAS);
    saved_registers(&e, X86_STORE);
    for (int32_t i = 0, segment = 1; i < flow->length; ++i) {
        const lag_node *x = flow->node + flow->order[i];
        const size_t pending = (size_t)e.r.pending_count;
        if (reserve(&e, (size_t)(2 + x->length / 4 + 3) * MOST_BYTES + 32 * pending))
            return (lag_code){0};
        if (x->segment != segment)
            lag_end_segment(&e.r);
        segment = x->segment;
        lag_begin_operation(&e.r, i);
        operation(&e, x);
    }
    if (e.unknown || reserve(&e, (2 + (size_t)e.r.pending_count) * MOST_BYTES))
        return (lag_code){0};
    lag_end_segment(&e.r);
    narrow(&e);
    saved_registers(&e, X86_LOAD);
    x86_add(code, X86_RSP, 8 + SHADOW);
    x86_pop(code, X86_RBP);
    x86_pop(code, X86_RBX);
    x86_return(code);
    return (lag_code){e.start, (size_t)(code->at - e.start), e.r.slots};
}
