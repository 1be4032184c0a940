/* The build defines LAGCLI_FINGERPRINT: lagcli/engine/core/fingerprint.py. */
#include "lagcore.h"

#ifndef LAGCLI_FINGERPRINT
#define LAGCLI_FINGERPRINT ""
#endif

const char *lag_fingerprint(void)
{
    return LAGCLI_FINGERPRINT;
}
