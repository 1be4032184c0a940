#include "tape/interval.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define ROUNDING DBL_EPSILON            /* of an arithmetic operation: twice its error */
#define FUNCTION (4.0 * DBL_EPSILON)    /* of a function of the C library */
#define LEAST 1e-300                    /* absolute, so that underflow is enclosed */
#define LARGE_ANGLE 1e9                 /* angles beyond this have any sine */
#define PI 3.14159265358979323846
#define POINT(x) ((lag_interval){(x), (x)})

static inline lag_interval outwards(double low, double high, double error)
{
    const lag_interval r = {low - fabs(low) * error - LEAST, high + fabs(high) * error + LEAST};
    if (r.low <= r.high)
        return r;
    if (low == INFINITY && high == INFINITY) /* by overflow */
        return (lag_interval){DBL_MAX, INFINITY};
    if (low == -INFINITY && high == -INFINITY)
        return (lag_interval){-INFINITY, -DBL_MAX};
    return LAG_ANYTHING;
}

static inline int is_zero(lag_interval a)
{
    return a.low == 0.0 && a.high == 0.0;
}

static inline int is_point(lag_interval a)
{
    return a.low == a.high;
}

static inline lag_interval negative(lag_interval a)
{
    return (lag_interval){-a.high, -a.low};
}

static inline lag_interval hull(lag_interval a, lag_interval b)
{
    return (lag_interval){fmin(a.low, b.low), fmax(a.high, b.high)};
}

/* Whether the sum of two numbers is exact (Knuth, The Art of Computer Programming, 4.2.2). */
static inline int is_exact_sum(double a, double b, double sum)
{
    const double rest = sum - a;
    return a - (sum - rest) == 0.0 && b - rest == 0.0;
}

/* The same of a product. */
static inline int is_exact_product(double a, double b, double product)
{
    return fma(a, b, -product) == 0.0 && fabs(product) > LEAST;
}

lag_interval lag_interval_add(lag_interval a, lag_interval b)
{
    if (is_zero(a))
        return b;
    if (is_zero(b))
        return a;
    /* values of functions that jump: whether they meet a bound is no matter of rounding */
    if (is_point(a) && is_point(b) && is_exact_sum(a.low, b.low, a.low + b.low))
        return POINT(a.low + b.low);
    return outwards(a.low + b.low, a.high + b.high, ROUNDING);
}

static inline lag_interval subtract(lag_interval a, lag_interval b)
{
    return lag_interval_add(a, negative(b));
}

lag_interval lag_interval_multiply(lag_interval a, lag_interval b)
{
    if (is_zero(a) || is_zero(b))
        return POINT(0.0);
    const double p = a.low * b.low, q = a.low * b.high, r = a.high * b.low, s = a.high * b.high;
    if (is_point(a) && is_point(b) && is_exact_product(a.low, b.low, p))
        return POINT(p);
    if (isnan(p) || isnan(q) || isnan(r) || isnan(s))
        return LAG_ANYTHING;
    const double l = p < q ? p : q, m = r < s ? r : s, h = p > q ? p : q, g = r > s ? r : s;
    return outwards(l < m ? l : m, h > g ? h : g, ROUNDING);
}

lag_interval lag_interval_scale(lag_interval a, double s)
{
    if (is_zero(a) || s == 0.0)
        return POINT(0.0);
    return s > 0.0 ? outwards(a.low * s, a.high * s, ROUNDING) : outwards(a.high * s, a.low * s, ROUNDING);
}

static lag_interval square(lag_interval a)
{
    if (is_zero(a))
        return a;
    const double low = a.low * a.low, high = a.high * a.high;
    if (is_point(a) && is_exact_product(a.low, a.low, low))
        return POINT(low);
    if (a.low > 0.0)
        return outwards(low, high, ROUNDING);
    if (a.high < 0.0)
        return outwards(high, low, ROUNDING);
    return (lag_interval){0.0, fmax(low, high) * (1.0 + ROUNDING) + LEAST};
}

static lag_interval divide(lag_interval a, lag_interval b)
{
    if (is_zero(a) && (b.low > 0.0 || b.high < 0.0))
        return a;
    if (!(b.low > 0.0 || b.high < 0.0))
        return LAG_ANYTHING;
    return lag_interval_multiply(a, outwards(1.0 / b.high, 1.0 / b.low, ROUNDING));
}

double lag_interval_size(lag_interval a)
{
    return fmax(fabs(a.low), fabs(a.high));
}

int lag_interval_sign(lag_interval a)
{
    return (a.low > 0.0) - (a.high < 0.0);
}

/* Values of functions. */

static lag_interval increasing(double (*f)(double), lag_interval a)
{
    return outwards(f(a.low), f(a.high), FUNCTION);
}

static lag_interval decreasing(double (*f)(double), lag_interval a)
{
    return outwards(f(a.high), f(a.low), FUNCTION);
}

/* The sine, or the cosine. */
static lag_interval wave(lag_interval a, int cosine)
{
    if (!(a.high - a.low < 2.0 * PI) || !(lag_interval_size(a) < LARGE_ANGLE))
        return (lag_interval){-1.0, 1.0};
    const double x = cosine ? cos(a.low) : sin(a.low), y = cosine ? cos(a.high) : sin(a.high);
    lag_interval r = outwards(fmin(x, y), fmax(x, y), FUNCTION);
    /* maxima at `top` + 2 pi k, minima half a period later */
    const double slack = FUNCTION * (1.0 + lag_interval_size(a)), top = cosine ? 0.0 : 0.5 * PI;
    if (floor((a.high + slack - top) / (2.0 * PI)) >= ceil((a.low - slack - top) / (2.0 * PI)))
        r.high = 1.0;
    if (floor((a.high + slack - top - PI) / (2.0 * PI)) >= ceil((a.low - slack - top - PI) / (2.0 * PI)))
        r.low = -1.0;
    return (lag_interval){fmax(r.low, -1.0), fmin(r.high, 1.0)};
}

static lag_interval tangent(double (*f)(double), lag_interval a)
{
    if (!(a.high - a.low < PI) || floor(a.low / PI + 0.5) != floor(a.high / PI + 0.5) || !(f(a.low) <= f(a.high)))
        return LAG_ANYTHING; /* across a pole */
    return increasing(f, a);
}

static lag_interval root(lag_interval a)
{
    if (!(a.low >= 0.0))
        return a.high >= 0.0 ? (lag_interval){0.0, sqrt(a.high) * (1.0 + ROUNDING)} : LAG_ANYTHING;
    lag_interval r = outwards(sqrt(a.low), sqrt(a.high), ROUNDING);
    r.low = fmax(r.low, 0.0);
    return r;
}

static lag_interval angle(lag_interval y, lag_interval x)
{
    const double c[] = {atan2(y.low, x.low), atan2(y.low, x.high), atan2(y.high, x.low), atan2(y.high, x.high)};
    if (!(x.low > 0.0 || y.low > 0.0 || y.high < 0.0))
        return (lag_interval){-PI * (1.0 + FUNCTION), PI * (1.0 + FUNCTION)};
    return outwards(fmin(fmin(c[0], c[1]), fmin(c[2], c[3])), fmax(fmax(c[0], c[1]), fmax(c[2], c[3])), FUNCTION);
}

/* A constant power. */
static lag_interval power(lag_interval a, double n)
{
    const int whole = n == floor(n), odd = whole && n != 2.0 * floor(0.5 * n);
    if (n == 0.0)
        return POINT(1.0);
    if (a.low > 0.0 || (a.low >= 0.0 && n > 0.0))
        return n > 0.0 ? outwards(pow(a.low, n), pow(a.high, n), FUNCTION)
                       : outwards(pow(a.high, n), pow(a.low, n), FUNCTION);
    if (!whole)
        return a.high > 0.0 && n > 0.0 ? outwards(0.0, pow(a.high, n), FUNCTION) : LAG_ANYTHING;
    if (a.high < 0.0) {
        const lag_interval r = power(negative(a), n);
        return odd ? negative(r) : r;
    }
    if (n < 0.0)
        return LAG_ANYTHING;
    return odd ? outwards(pow(a.low, n), pow(a.high, n), FUNCTION)
               : outwards(0.0, pow(lag_interval_size(a), n), FUNCTION);
}

/* A function that is constant where it does not jump. */
static void constant_jet(lag_interval value, lag_interval *c, int order)
{
    c[0] = value;
    for (int k = 1; k <= order; ++k)
        c[k] = is_point(value) ? POINT(0.0) : LAG_ANYTHING; /* it jumps */
}

/* Jets of functions. `w`, `x`, `z` stand for jets of intermediate results. */

void lag_jet_multiply(const lag_interval *a, const lag_interval *b, lag_interval *c, int order)
{
    for (int k = 0; k <= order; ++k) {
        lag_interval sum;
        if (a == b) {
            sum = k % 2 ? POINT(0.0) : square(a[k / 2]);
            for (int i = 0; 2 * i < k; ++i)
                sum = lag_interval_add(sum, lag_interval_scale(lag_interval_multiply(a[i], a[k - i]), 2.0));
        } else {
            sum = lag_interval_multiply(a[0], b[k]);
            for (int i = 1; i <= k; ++i)
                sum = lag_interval_add(sum, lag_interval_multiply(a[i], b[k - i]));
        }
        c[k] = sum;
    }
}

static void quotient(const lag_interval *a, const lag_interval *b, lag_interval *c, int order)
{
    for (int k = 0; k <= order; ++k) {
        lag_interval sum = a[k];
        for (int i = 1; i <= k; ++i)
            sum = subtract(sum, lag_interval_multiply(b[i], c[k - i]));
        c[k] = divide(sum, b[0]);
    }
}

/* c_k of a function whose derivative is w times that of a: from c_0 and w_0 to w_(k-1). */
static lag_interval next_coefficient(const lag_interval *a, const lag_interval *w, int k)
{
    lag_interval sum = POINT(0.0);
    for (int i = 1; i <= k; ++i)
        sum = lag_interval_add(sum, lag_interval_multiply(lag_interval_scale(a[i], i), w[k - i]));
    return lag_interval_scale(sum, 1.0 / k);
}

/* The derivatives of a function of a constant; 1 if `a` is one. */
static int derivatives_of_constant(const lag_interval *a, lag_interval *c, int order)
{
    for (int k = 1; k <= order; ++k)
        if (!is_zero(a[k]))
            return 0;
    for (int k = 1; k <= order; ++k)
        c[k] = POINT(0.0);
    return 1;
}

static void root_jet(const lag_interval *a, lag_interval *c, int order)
{
    c[0] = root(a[0]);
    if (derivatives_of_constant(a, c, order)) /* also at zero */
        return;
    for (int k = 1; k <= order; ++k) {
        lag_interval sum = a[k];
        for (int i = 1; i < k; ++i)
            sum = subtract(sum, lag_interval_multiply(c[i], c[k - i]));
        c[k] = divide(sum, lag_interval_scale(c[0], 2.0));
    }
}

static void exponential_jet(const lag_interval *a, lag_interval *c, int order)
{
    c[0] = increasing(exp, a[0]);
    c[0].low = fmax(c[0].low, 0.0);
    for (int k = 1; k <= order; ++k)
        c[k] = next_coefficient(a, c, k);
}

static void logarithm_jet(const lag_interval *a, lag_interval *c, int order)
{
    c[0] = a[0].low > 0.0    ? increasing(log, a[0])
           : a[0].high > 0.0 ? (lag_interval){-INFINITY, outwards(log(a[0].high), log(a[0].high), FUNCTION).high}
                             : LAG_ANYTHING;
    for (int k = 1; k <= order; ++k) {
        lag_interval sum = POINT(0.0);
        for (int i = 1; i < k; ++i)
            sum = lag_interval_add(sum, lag_interval_multiply(lag_interval_scale(c[i], i), a[k - i]));
        c[k] = divide(subtract(a[k], lag_interval_scale(sum, 1.0 / k)), a[0]);
    }
}

/* The sine and the cosine (sign -1), or the hyperbolic ones (1). */
static void wave_jets(const lag_interval *a, lag_interval *s, lag_interval *c, double sign, int order)
{
    if (sign < 0.0) {
        s[0] = wave(a[0], 0);
        c[0] = wave(a[0], 1);
    } else {
        s[0] = increasing(sinh, a[0]);
        c[0] = outwards(a[0].low <= 0.0 && a[0].high >= 0.0 ? 1.0 : fmin(cosh(a[0].low), cosh(a[0].high)),
                        fmax(cosh(a[0].low), cosh(a[0].high)), FUNCTION);
    }
    for (int k = 1; k <= order; ++k) {
        s[k] = next_coefficient(a, c, k);
        c[k] = lag_interval_scale(next_coefficient(a, s, k), sign);
    }
}

static void power_jet(const lag_interval *a, const lag_interval *b, lag_interval *c, int order)
{
    int constant = is_point(b[0]);
    for (int k = 1; k <= order; ++k)
        constant &= is_zero(b[k]);
    if (!constant) { /* exp(b log a) */
        lag_interval w[JET], x[JET];
        logarithm_jet(a, w, order);
        lag_jet_multiply(b, w, x, order);
        exponential_jet(x, c, order);
        return;
    }
    const double n = b[0].low;
    c[0] = power(a[0], n);
    if (derivatives_of_constant(a, c, order))
        return;
    for (int k = 1; k <= order; ++k) {
        lag_interval sum = POINT(0.0);
        for (int i = 1; i <= k; ++i)
            sum = lag_interval_add(sum,
                                   lag_interval_multiply(lag_interval_scale(a[i], i * n - (k - i)), c[k - i]));
        c[k] = divide(lag_interval_scale(sum, 1.0 / k), a[0]);
    }
    if (n == 2.0)
        lag_jet_multiply(a, a, c, order);
}

static void angle_jet(const lag_interval *y, const lag_interval *x, lag_interval *c, int order)
{
    lag_interval w[JET], z[JET], rate[JET];
    c[0] = angle(y[0], x[0]);
    if (c[0].high - c[0].low >= 2.0 * PI) { /* it may jump, whatever its derivative is */
        constant_jet(c[0], c, order);
        return;
    }
    if (order == 0)
        return;
    lag_jet_multiply(x, x, w, order);
    lag_jet_multiply(y, y, z, order);
    for (int k = 0; k <= order; ++k)
        w[k] = lag_interval_add(w[k], z[k]);
    for (int k = 0; k < order; ++k) { /* x y' - y x' */
        z[k] = POINT(0.0);
        for (int i = 0; i <= k; ++i) {
            const double n = k - i + 1;
            z[k] = lag_interval_add(z[k], lag_interval_multiply(x[i], lag_interval_scale(y[k - i + 1], n)));
            z[k] = subtract(z[k], lag_interval_multiply(y[i], lag_interval_scale(x[k - i + 1], n)));
        }
    }
    quotient(z, w, rate, order - 1);
    for (int k = 1; k <= order; ++k)
        c[k] = lag_interval_scale(rate[k - 1], 1.0 / k);
}

/* Jets as values, of which the derivatives in tables.h are made. n is the order. */

typedef struct {
    lag_interval k[JET];
} jet;

static inline jet constant(double x)
{
    return (jet){{POINT(x)}};
}

static inline jet add(jet a, jet b, int n)
{
    for (int k = 0; k <= n; ++k)
        a.k[k] = lag_interval_add(a.k[k], b.k[k]);
    return a;
}

static inline jet sub(jet a, jet b, int n)
{
    for (int k = 0; k <= n; ++k)
        a.k[k] = subtract(a.k[k], b.k[k]);
    return a;
}

static inline jet mul(jet a, jet b, int n)
{
    jet c;
    lag_jet_multiply(a.k, b.k, c.k, n);
    return c;
}

static inline jet sqr(jet a, int n)
{
    jet c;
    lag_jet_multiply(a.k, a.k, c.k, n);
    return c;
}

static inline jet div(jet a, jet b, int n)
{
    jet c;
    quotient(a.k, b.k, c.k, n);
    return c;
}

static inline jet jet_sqrt(jet a, int n)
{
    jet c;
    root_jet(a.k, c.k, n);
    return c;
}

static inline jet jet_exp(jet a, int n)
{
    jet c;
    exponential_jet(a.k, c.k, n);
    return c;
}

static inline jet jet_log(jet a, int n)
{
    jet c;
    logarithm_jet(a.k, c.k, n);
    return c;
}

/* Functions that follow from their derivative. */
#define DEFINE(op, value, enclosure, low, high, slope) \
    static double value_##op(double A) \
    { \
        return value; \
    } \
    static jet slope_##op(jet A, jet C, int n) \
    { \
        (void)A, (void)C; \
        return slope; \
    }
LAG_FUNCTIONS(DEFINE)

static void function_jet(lag_interval (*enclose)(double (*)(double), lag_interval), double (*value)(double),
                         double low, double high, jet (*slope)(jet, jet, int), const lag_interval *a,
                         lag_interval *c, int order)
{
    const lag_interval within = {fmax(a[0].low, low), fmin(a[0].high, high)};
    jet x, y;
    c[0] = within.low <= within.high ? enclose(value, within) : LAG_ANYTHING;
    if (!(lag_interval_size(c[0]) < INFINITY)) { /* across a pole, although the derivative has one sign */
        constant_jet(c[0], c, order);
        return;
    }
    memcpy(x.k, a, (size_t)(order + 1) * sizeof *a);
    for (int k = 1; k <= order; ++k) {
        memcpy(y.k, c, (size_t)k * sizeof *c);
        c[k] = next_coefficient(a, slope(x, y, k - 1).k, k);
    }
}

static void magnitude_jet(const lag_interval *a, lag_interval *c, int order)
{
    const int sign = lag_interval_sign(a[0]);
    for (int k = 0; k <= order; ++k)
        c[k] = sign > 0   ? a[k]
               : sign < 0 ? negative(a[k])
               : k == 0   ? (lag_interval){0.0, lag_interval_size(a[0])}
               : k == 1   ? hull(a[k], negative(a[k]))
                          : LAG_ANYTHING;
}

/* 1 where a relation holds, 0 where it does not, or both. */
static lag_interval relation(int op, lag_interval a, lag_interval b)
{
    const int same = is_point(a) && is_point(b) && a.low == b.low;
    const int apart = a.high < b.low || a.low > b.high;
    int holds, fails;
    switch (op) {
    case OP_LT:
        holds = a.high < b.low;
        fails = a.low >= b.high;
        break;
    case OP_LE:
        holds = a.high <= b.low;
        fails = a.low > b.high;
        break;
    case OP_EQ:
        holds = same;
        fails = apart;
        break;
    default:
        holds = apart;
        fails = same;
    }
    return (lag_interval){holds ? 1.0 : 0.0, fails ? 0.0 : 1.0};
}

static void choice_jet(const lag_interval *a, const lag_interval *b, const lag_interval *c, lag_interval *out,
                       int order)
{
    const int yes = a[0].low > 0.0 || a[0].high < 0.0, no = is_zero(a[0]);
    for (int k = 0; k <= order; ++k)
        out[k] = yes ? b[k] : no ? c[k] : k == 0 ? hull(b[k], c[k]) : LAG_ANYTHING;
}

/* Whether an operation has no value anywhere in an interval. */
static int has_no_value(int op, lag_interval A, const lag_interval *b)
{
    switch (op) {
#define NO_VALUE(op, outside) \
    case op: \
        return outside;
        LAG_DOMAINS(NO_VALUE)
    case OP_POW:
        return A.high < 0.0 && b->low == b->high && b->low != floor(b->low);
    default:
        return 0;
    }
}

/* One operation of a tape, on jets; out is none of the operands. */
static void operate(int op, const lag_interval *a, const lag_interval *b, const lag_interval *c,
                    lag_interval *out, int order)
{
    lag_interval w[JET];
    switch (op) {
    case OP_ADD:
        for (int k = 0; k <= order; ++k)
            out[k] = lag_interval_add(a[k], b[k]);
        break;
    case OP_SUB:
        for (int k = 0; k <= order; ++k)
            out[k] = subtract(a[k], b[k]);
        break;
    case OP_MUL:
        lag_jet_multiply(a, b, out, order);
        break;
    case OP_MULADD:
    case OP_MULSUB:
    case OP_SUBMUL:
        lag_jet_multiply(a, b, w, order);
        for (int k = 0; k <= order; ++k)
            out[k] = op == OP_MULADD   ? lag_interval_add(w[k], c[k])
                     : op == OP_MULSUB ? subtract(w[k], c[k])
                                       : subtract(c[k], w[k]);
        break;
    case OP_DIV:
        quotient(a, b, out, order);
        break;
    case OP_NEG:
        for (int k = 0; k <= order; ++k)
            out[k] = negative(a[k]);
        break;
    case OP_MOVE:
        memcpy(out, a, (size_t)(order + 1) * sizeof *out);
        break;
    case OP_POW:
        power_jet(a, b, out, order);
        break;
    case OP_SQRT:
        root_jet(a, out, order);
        break;
    case OP_CLIP: /* rounding below zero is zero */
        memcpy(out, a, (size_t)(order + 1) * sizeof *out);
        if (out[0].low < 0.0)
            out[0].high = fmax(out[0].high, 0.0);
        break;
    case OP_SIN:
        wave_jets(a, out, w, -1.0, order);
        break;
    case OP_COS:
        wave_jets(a, w, out, -1.0, order);
        break;
    case OP_SINH:
        wave_jets(a, out, w, 1.0, order);
        break;
    case OP_COSH:
        wave_jets(a, w, out, 1.0, order);
        break;
#define CASE(op, value, enclosure, low, high, slope) \
    case op: \
        function_jet(enclosure, value_##op, low, high, slope_##op, a, out, order); \
        break;
        LAG_FUNCTIONS(CASE)
    case OP_ATAN2:
        angle_jet(a, b, out, order);
        break;
    case OP_EXP:
        exponential_jet(a, out, order);
        break;
    case OP_LOG:
        logarithm_jet(a, out, order);
        break;
    case OP_FLOOR:
        constant_jet((lag_interval){floor(a[0].low), floor(a[0].high)}, out, order);
        break;
    case OP_CEIL:
        constant_jet((lag_interval){ceil(a[0].low), ceil(a[0].high)}, out, order);
        break;
    case OP_ABS:
        magnitude_jet(a, out, order);
        break;
    case OP_LT:
    case OP_LE:
    case OP_EQ:
    case OP_NE:
        constant_jet(relation(op, a[0], b[0]), out, order);
        break;
    case OP_AND:
        constant_jet((lag_interval){a[0].low * b[0].low, a[0].high * b[0].high}, out, order);
        break;
    case OP_OR:
        constant_jet((lag_interval){fmax(a[0].low, b[0].low), fmax(a[0].high, b[0].high)}, out, order);
        break;
    case OP_NOT:
        constant_jet((lag_interval){1.0 - a[0].high, 1.0 - a[0].low}, out, order);
        break;
    case OP_SELECT:
        choice_jet(a, b, c, out, order);
        break;
    default: /* an operation without a rule encloses nothing */
        for (int k = 0; k <= order; ++k)
            out[k] = LAG_ANYTHING;
    }
}

/* The registers of the operands of a vector operation. */
typedef struct {
    int32_t first, step;
    const int32_t *places;
} operand;

static operand next_operand(const int32_t **p, int n)
{
    operand x = {(*p)[0], (*p)[1], *p + 2};
    *p += 2 + (x.step == LAG_INDEXED ? n : 0);
    return x;
}

static int64_t place_of(const operand *x, int k)
{
    return x->step == LAG_INDEXED ? x->places[k] : x->first + (int64_t)k * x->step;
}

static const int places_of[] = LAG_PLACES;

/* Mark the inputs that a stream reads. */
static void mark_inputs(const int32_t *p, int inputs, char *used)
{
    for (;;) {
        int op = *p++;
        const int n = *p++;
        if (op == OP_END)
            return;
        if (op >= LAG_VECTOR) {
            const int operands = places_of[op - LAG_VECTOR] - 1;
            ++p;
            for (int i = 0; i < operands; ++i) {
                const operand x = next_operand(&p, n);
                for (int k = 0; k < n; ++k)
                    if (place_of(&x, k) < inputs)
                        used[place_of(&x, k)] = 1;
            }
            continue;
        }
        const int places = places_of[op], results = op == OP_SINCOS ? 2 : 1;
        for (const int32_t *end = p + (int64_t)places * n; p != end; p += places)
            for (int i = results; i < places; ++i)
                if (p[i] < inputs)
                    used[p[i]] = 1;
    }
}

void lag_jets_bind(lag_jet_tape *jets, lag_pool *pool, const lag_tape *tape, const lag_program *program, int np)
{
    *jets = (lag_jet_tape){.tape = tape, .inputs = program->inputs - np, .count = program->register_count, .stale = 1};
    jets->registers = lag_get(pool, (size_t)JET * (size_t)jets->count, sizeof *jets->registers);
    jets->used = lag_get(pool, (size_t)jets->inputs, 1);
    if (pool->failed)
        return;
    mark_inputs(tape->stream.code, jets->inputs, jets->used);
    for (int64_t i = 0; i < program->output_count; ++i)
        if (tape->outputs[i] < jets->inputs)
            jets->used[tape->outputs[i]] = 1;
}

void lag_jets_of_tape(lag_jet_tape *jets, const lag_tape *tape)
{
    *jets = (lag_jet_tape){.tape = tape, .inputs = (int)(tape->parameters - tape->registers),
                           .count = tape->register_count, .registers = jets->registers, .stale = 1};
}

void lag_jets_refresh(lag_jet_tape *jets)
{
    if (!jets->stale)
        return;
    jets->stale = 0;
    for (int64_t i = jets->inputs; i < jets->count; ++i) {
        lag_interval *r = jets->registers + JET * i;
        memset(r, 0, JET * sizeof *r);
        r[0] = POINT(jets->tape->registers[i]);
    }
}

/* Narrow a jet on an interval by the jet at its middle: each coefficient is that there and what its derivative, the next
 * one but for a factor, adds until an end. */
static void narrow(lag_interval *c, const lag_interval *middle, double radius, int order)
{
    for (int k = order - 1; k >= 0; --k) {
        const double reach = lag_interval_size(c[k + 1]) * (k + 1) * radius;
        const lag_interval about = lag_interval_add(middle[k], (lag_interval){-reach, reach});
        const lag_interval both = {fmax(c[k].low, about.low), fmin(c[k].high, about.high)};
        if (both.low <= both.high)
            c[k] = both;
    }
}

/* Evaluate a stream of a tape; with jets at the middle of the interval, each result is narrowed. */
static void run(lag_jet_tape *jets, const int32_t *p, lag_jet_tape *middle, double radius, int order)
{
    lag_interval *r = jets->registers, *m = middle ? middle->registers : NULL, out[JET], other[JET];
    lag_interval at_middle[JET], other_at_middle[JET];
    const size_t size = (size_t)(order + 1) * sizeof *out;
    jets->undefined = 0;
    for (;;) {
        int op = *p++;
        const int n = *p++;
        if (op == OP_END)
            return;
        if (op >= LAG_VECTOR) {
            op -= LAG_VECTOR;
            const int64_t to = *p++;
            const int operands = places_of[op] - 1;
            operand x[3] = {{0}, {0}, {0}};
            for (int i = 0; i < operands; ++i)
                x[i] = next_operand(&p, n);
            for (int k = 0; k < n; ++k) {
                const int64_t a = JET * place_of(x, k), b = JET * place_of(x + 1, k), c = JET * place_of(x + 2, k);
                operate(op, r + a, r + b, r + c, r + JET * (to + k), order);
                if (!m)
                    continue;
                operate(op, m + a, m + b, m + c, m + JET * (to + k), order);
                narrow(r + JET * (to + k), m + JET * (to + k), radius, order);
            }
            continue;
        }
        const int places = places_of[op];
        for (const int32_t *end = p + (int64_t)places * n; p != end; p += places) {
            if (op == OP_SINCOS) {
                wave_jets(r + (int64_t)JET * p[2], out, other, -1.0, order);
                if (m) {
                    wave_jets(m + (int64_t)JET * p[2], at_middle, other_at_middle, -1.0, order);
                    narrow(out, at_middle, radius, order);
                    narrow(other, other_at_middle, radius, order);
                    memcpy(m + (int64_t)JET * p[0], at_middle, size);
                    memcpy(m + (int64_t)JET * p[1], other_at_middle, size);
                }
                memcpy(r + (int64_t)JET * p[0], out, size);
                memcpy(r + (int64_t)JET * p[1], other, size);
                continue;
            }
            const int64_t to = (int64_t)JET * p[0], a = (int64_t)JET * p[1];
            const int64_t b = places > 2 ? (int64_t)JET * p[2] : a, c = places > 3 ? (int64_t)JET * p[3] : a;
            operate(op, r + a, r + b, r + c, out, order);
            jets->undefined |= has_no_value(op, r[a], r + b);
            if (m) {
                operate(op, m + a, m + b, m + c, at_middle, order);
                narrow(out, at_middle, radius, order);
                memcpy(m + to, at_middle, size);
            }
            memcpy(r + to, out, size);
        }
    }
}

void lag_jets_run(lag_jet_tape *jets, int order)
{
    run(jets, jets->tape->stream.code, NULL, 0.0, order);
}

void lag_jets_run_part(lag_jet_tape *jets, const lag_stream *part, int order)
{
    run(jets, part->code, NULL, 0.0, order);
}

void lag_jets_run_about(lag_jet_tape *jets, lag_jet_tape *middle, double radius, int order)
{
    run(jets, jets->tape->stream.code, middle, radius, order);
}

int lag_enclose_program(const lag_memory *memory, const lag_program *program, const double *inputs, double high,
                        int order, int narrowed, double *out)
{
    lag_pool pool = lag_pool_of(memory);
    lag_tape tape = {.vectors = lag_vectors(LAG_PORTABLE),
                     .registers = lag_copy_doubles(&pool, program->registers, program->register_count),
                     .stream = {.code = program->main.code},
                     .outputs = program->outputs};
    lag_jet_tape jets, middle;
    lag_jets_bind(&jets, &pool, &tape, program, 0);
    lag_jets_bind(&middle, &pool, &tape, program, 0);
    const int failed = pool.failed;
    if (!failed) {
        memcpy(tape.registers, inputs, (size_t)program->inputs * sizeof(double));
        tape.vectors->run(program->prelude.code, tape.registers);
        const double at = inputs[0] + 0.5 * (high - inputs[0]), radius = fmax(high - at, at - inputs[0]);
        lag_jets_refresh(&jets);
        lag_jets_refresh(&middle);
        for (int i = 0; i < program->inputs; ++i)
            lag_jet_input(&jets, i)[0] = lag_jet_input(&middle, i)[0] = POINT(inputs[i]);
        lag_jet_input(&jets, 0)[0].high = high;
        lag_jet_input(&middle, 0)[0] = POINT(at);
        lag_jet_input(&jets, 0)[1] = lag_jet_input(&middle, 0)[1] = POINT(1.0);
        run(&jets, tape.stream.code, narrowed ? &middle : NULL, radius, order);
        for (int64_t i = 0; i < program->output_count; ++i)
            for (int k = 0; k <= order; ++k, out += 2) {
                out[0] = lag_jet_output(&jets, (int)i)[k].low;
                out[1] = lag_jet_output(&jets, (int)i)[k].high;
            }
    }
    lag_release(&pool);
    return failed;
}
