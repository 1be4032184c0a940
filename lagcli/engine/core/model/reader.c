#include "model/reader.h"

#include <math.h>
#include <string.h>

#define MOST (1 << 24) /* things that are counted by an int */

void lag_reject(lag_reader *in, int status)
{
    if (in->status == LAG_MODEL_READ)
        in->status = status;
    in->words = 0;
}

int64_t lag_read_word(lag_reader *in)
{
    int64_t value = 0;
    if (in->words < 1) {
        lag_reject(in, LAG_MODEL_LENGTH);
        return 0;
    }
    memcpy(&value, in->at, sizeof value);
    in->at += sizeof value;
    --in->words;
    return value;
}

int lag_read_int(lag_reader *in, int64_t low, int64_t high)
{
    const int64_t value = lag_read_word(in);
    if (value < low || value > high)
        lag_reject(in, LAG_MODEL_INDEX);
    return in->status == LAG_MODEL_READ ? (int)value : 0;
}

int lag_read_count(lag_reader *in)
{
    const int64_t value = lag_read_word(in);
    if (value < 0 || value > MOST)
        lag_reject(in, LAG_MODEL_SIZES);
    return in->status == LAG_MODEL_READ ? (int)value : 0;
}

double lag_read_number(lag_reader *in)
{
    const int64_t word = lag_read_word(in);
    double value;
    memcpy(&value, &word, sizeof value);
    return value;
}

double lag_read_one(lag_reader *in)
{
    const double value = lag_read_number(in);
    if (!isfinite(value))
        lag_reject(in, LAG_MODEL_NUMBER);
    return value;
}

/* `per` to a word, as many as the data say; their number to *number. Never NULL. */
static const void *items(lag_reader *in, int per, int64_t *number)
{
    const int64_t n = lag_read_word(in), words = n / per + (n % per != 0);
    const char *at = in->at;
    *number = 0;
    if (n < 0 || words > in->words)
        lag_reject(in, LAG_MODEL_LENGTH);
    if (in->status != LAG_MODEL_READ)
        return at;
    in->at += 8 * words;
    in->words -= words;
    *number = n;
    return at;
}

const int32_t *lag_read_list(lag_reader *in, int64_t *count)
{
    return items(in, 2, count);
}

const int32_t *lag_read_integers(lag_reader *in, int64_t n, int64_t low, int64_t high)
{
    int64_t number;
    const int32_t *at = items(in, 2, &number);
    if (number != n)
        lag_reject(in, LAG_MODEL_SIZES);
    for (int64_t i = 0; in->status == LAG_MODEL_READ && i < n; ++i)
        if (at[i] < low || at[i] >= high)
            lag_reject(in, LAG_MODEL_INDEX);
    return at;
}

const double *lag_read_any(lag_reader *in, int64_t *count)
{
    return items(in, 1, count);
}

const double *lag_read_numbers(lag_reader *in, int64_t *count)
{
    const double *at = items(in, 1, count);
    for (int64_t i = 0; in->status == LAG_MODEL_READ && i < *count; ++i)
        if (!isfinite(at[i]))
            lag_reject(in, LAG_MODEL_NUMBER);
    return at;
}

const double *lag_read_finite(lag_reader *in, int64_t n)
{
    int64_t number;
    const double *at = lag_read_numbers(in, &number);
    if (number != n)
        lag_reject(in, LAG_MODEL_SIZES);
    return at;
}

void lag_read_nothing(lag_reader *in)
{
    lag_read_int(in, 0, 0);
}

lag_stream lag_read_stream(lag_reader *in)
{
    lag_stream made;
    made.code = lag_read_list(in, &made.length);
    if (!made.length)
        made.code = NULL;
    return made;
}

lag_program lag_read_program(lag_reader *in, int64_t inputs, int64_t outputs)
{
    lag_program made;
    made.prelude = lag_read_stream(in);
    made.main = lag_read_stream(in);
    for (int i = 0; i < 3; ++i)
        made.deferred[i] = lag_read_stream(in);
    for (int i = 0; i < 2; ++i)
        made.output_subsets[i] = lag_read_stream(in);
    made.inputs = lag_read_count(in);
    made.registers = items(in, 1, &made.register_count);
    made.outputs = lag_read_list(in, &made.output_count);
    if (in->status == LAG_MODEL_READ && lag_check_program(&made) != LAG_MODEL_READ)
        lag_reject(in, LAG_MODEL_PROGRAM);
    if (in->status == LAG_MODEL_READ && (made.inputs != inputs || made.output_count < outputs))
        lag_reject(in, LAG_MODEL_OUTPUTS);
    return made;
}
