#include "methods/method.h"

#include <stddef.h>

#define POINTER(method) &method,
static const lag_method *const methods[] = {LAG_METHODS(POINTER)};

const lag_method *lag_method_at(int i)
{
    return i >= 0 && i < (int)(sizeof methods / sizeof *methods) ? methods[i] : NULL;
}

const char *lag_method_name(const lag_method *method)
{
    return method->name;
}
