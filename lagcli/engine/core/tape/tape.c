#include "tape/tape.h"

#include <math.h>
#include <string.h>

void lag_tape_set(const lag_tape *tape, int n, const double *parameters)
{
    memcpy(tape->parameters, parameters, (size_t)n * sizeof(double));
    tape->registers[0] = NAN; /* no state yet */
    lag_tape_run(tape, tape->prelude);
}
