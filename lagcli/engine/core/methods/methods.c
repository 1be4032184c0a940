#include "methods/method.h"

#include <stddef.h>

/* All methods. */
static const lag_method *const methods[] = {&lag_dop853, &lag_rodas5p, &lag_radau5, &lag_taylor};

const lag_method *lag_method_at(int i)
{
    return i >= 0 && i < (int)(sizeof methods / sizeof *methods) ? methods[i] : NULL;
}

const char *lag_method_name(const lag_method *method)
{
    return method->name;
}
