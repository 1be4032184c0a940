/* Reading of data word by word. What is wrong is kept; then nothing is left to read. */
#ifndef LAGCLI_READER_H
#define LAGCLI_READER_H

#include "lagmodel.h"

typedef struct {
    const char *at;
    int64_t words;                     /* left */
    int status;                        /* a lag_model_status */
} lag_reader;

void lag_reject(lag_reader *in, int status);

int64_t lag_read_word(lag_reader *in);

/* An integer in [low, high]. */
int lag_read_int(lag_reader *in, int64_t low, int64_t high);

/* A number of things. */
int lag_read_count(lag_reader *in);

/* A number, finite or not; a finite one. */
double lag_read_number(lag_reader *in);
double lag_read_one(lag_reader *in);

/* Integers, as many as the data say, their number to *count; exactly n, from `low` to below `high`. Never NULL. */
const int32_t *lag_read_list(lag_reader *in, int64_t *count);
const int32_t *lag_read_integers(lag_reader *in, int64_t n, int64_t low, int64_t high);

/* The same of numbers, which must be finite but for those of the first function. */
const double *lag_read_any(lag_reader *in, int64_t *count);
const double *lag_read_numbers(lag_reader *in, int64_t *count);
const double *lag_read_finite(lag_reader *in, int64_t n);

/* Nothing: a pointer that is NULL. */
void lag_read_nothing(lag_reader *in);

/* A stream, NULL if it is empty; a program with so many inputs and at least so many outputs, checked. */
lag_stream lag_read_stream(lag_reader *in);
lag_program lag_read_program(lag_reader *in, int64_t inputs, int64_t outputs);

#endif
