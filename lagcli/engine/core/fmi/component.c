#include "fmi/component.h"

#include <stdlib.h>
#include <string.h>

/* The value of a hexadecimal digit; -1. */
static int digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* The path of a URI, which may also be a path, with a separator at its end. */
static char *path_of(const char *uri)
{
    static const char scheme[] = "file:";
    char *path = malloc(strlen(uri) + 2), *to = path;
    if (!path)
        return NULL;
    const int encoded = !strncmp(uri, scheme, sizeof scheme - 1);
    if (encoded) {
        uri += sizeof scheme - 1;
        if (!strncmp(uri, "//", 2)) {
            uri += 2;
            while (*uri && *uri != '/') /* the host */
                ++uri;
        }
        if (uri[0] == '/' && uri[1] && uri[2] == ':') /* of a drive: /C:/ */
            ++uri;
    }
    for (; *uri; ++uri) {
        if (encoded && *uri == '%' && digit(uri[1]) >= 0 && digit(uri[2]) >= 0) {
            *to++ = (char)(16 * digit(uri[1]) + digit(uri[2]));
            uri += 2;
        } else {
            *to++ = *uri;
        }
    }
    if (to > path && to[-1] != '/' && to[-1] != '\\')
        *to++ = '/';
    *to = '\0';
    return path;
}

lag_component *lag_component_make(const char *name, const char *resources, int exchange, lag_fmu_message *message,
                                  void *environment, const void *callbacks)
{
    lag_component *c = calloc(1, sizeof *c);
    char *path = resources ? path_of(resources) : NULL;
    if (c) {
        c->environment = environment;
        c->callbacks = callbacks;
        c->name = calloc(strlen(name ? name : "") + 1, 1);
        if (c->name && name)
            memcpy(c->name, name, strlen(name));
    }
    if (c && c->name && path)
        c->fmu = lag_fmu_open(path, exchange, message, c);
    free(path);
    if (c && !c->fmu) {
        lag_component_free(c);
        c = NULL;
    }
    return c;
}

void lag_component_free(lag_component *c)
{
    if (!c)
        return;
    if (c->fmu)
        lag_fmu_close(c->fmu);
    free(c->name);
    free(c);
}

int lag_component_save(lag_component *c, void **state)
{
    lag_fmu_forget(*state);
    *state = lag_fmu_save(c->fmu);
    return !*state;
}

int lag_component_serialize(lag_component *c, const void *state, void *bytes, size_t size)
{
    size_t needed;
    const void *from = lag_fmu_bytes_of(state, &needed);
    if (!from)
        return lag_fmu_fail(c->fmu, "there is no state to serialize");
    if (size < needed)
        return lag_fmu_fail(c->fmu, "the state has %zu bytes, more than the %zu there is room for", needed, size);
    memcpy(bytes, from, needed);
    return 0;
}

int lag_component_deserialize(lag_component *c, const void *bytes, size_t size, void **state)
{
    *state = lag_fmu_state_from(c->fmu, bytes, size);
    return !*state;
}
