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

/* States of both versions: save one, where *state is NULL or one that is replaced; write one to bytes; read one. These
 * functions return 0, or 1, and a message, if that fails. */
int lag_component_save(lag_component *component, void **state);
int lag_component_serialize(lag_component *component, const void *state, void *bytes, size_t size);
int lag_component_deserialize(lag_component *component, const void *bytes, size_t size, void **state);

#endif
