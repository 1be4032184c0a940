/* What both versions of FMI hand out as an instance. */
#ifndef LAGCLI_COMPONENT_H
#define LAGCLI_COMPONENT_H

#include "fmi/instance.h"

/* A function of FMI with one answer, whatever its arguments. */
#define LAG_ALWAYS(type, status, name, ...)                                                                           \
    type name(void *component, __VA_ARGS__)                                                                           \
    {                                                                                                                 \
        (void)component;                                                                                              \
        return status;                                                                                                \
    }

typedef struct {
    lag_fmu *fmu;
    char *name;
    void *environment;                 /* of FMI 3.0 */
    const void *callbacks;             /* of the importing tool */
} lag_component;

/* Make an instance; NULL if that fails. `resources` is a path, or a URI of the scheme `file`. */
lag_component *lag_component_make(const char *name, const char *resources, int exchange, lag_fmu_message *message,
                                  void *environment, const void *callbacks);
void lag_component_free(lag_component *component);

#endif
