/* Operations on vectors of series, whose coefficients of one order lie side by side in layers. */
#ifndef LAGCLI_SERIES_LAYERS_H
#define LAGCLI_SERIES_LAYERS_H

#include "series/series.h"

/* Coefficient k of an operation on n series at a time. Returns what follows it in the stream. */
const int32_t *lag_series_run_vector(const lag_series *series, int32_t op, int n, const int32_t *p,
                                     int k);

#endif
