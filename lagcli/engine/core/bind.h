/* Binding of programs to register files. */
#ifndef LAGCLI_BIND_H
#define LAGCLI_BIND_H

#include "run.h"

const int32_t *lag_copy_stream(lag_pool *pool, const lag_stream *stream);

/* Copy a program to a tape. */
void lag_bind_program(lag_pool *pool, lag_tape *tape, const lag_program *program, int kernel);

/* Bind a program to its own register file, with the run's parameters. Returns 0, or 1 if there
 * is no memory. */
int lag_bind(lag_run *run, lag_pool *pool, lag_tape *tape, const lag_program *program);

/* Emit the code of a tape's outputs at the next call if so many calls, which will come, are worth it. */
void lag_expect(const lag_tape *tape, int64_t calls);

/* Expect so many times the calls of each of a tape's routines since the last time. */
void lag_foresee(const lag_tape *tape, double times);

#endif
