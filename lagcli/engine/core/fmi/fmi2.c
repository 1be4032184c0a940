/* The functions of FMI 2.0.4 (https://fmi-standard.org): co-simulation and model exchange. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/component.h"
#include "fmi/directional.h"

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void *fmi2Component;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Byte;
typedef const char *fmi2String;
typedef unsigned fmi2ValueReference;
typedef void *fmi2FMUstate;

typedef struct {
    void (*logger)(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, fmi2Status status);
    void *environment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean new_discrete_states_needed, terminate_simulation, nominals_changed, values_changed;
    fmi2Boolean next_event_time_defined;
    fmi2Real next_event_time;
} fmi2EventInfo;

static void log_message(void *context, const char *text)
{
    const lag_component *c = context;
    const fmi2CallbackFunctions *callbacks = c->callbacks;
    if (!callbacks || !callbacks->logger)
        return;
    char format[2 * LAG_MESSAGE], *to = format; /* the message is a format */
    for (; *text && to < format + sizeof format - 2; ++text) {
        *to++ = *text;
        if (*text == '%')
            *to++ = '%';
    }
    *to = '\0';
    callbacks->logger(callbacks->environment, c->name, fmi2Error, "logStatusError", format);
}

static fmi2Status status_of(int failed)
{
    return failed == LAG_FMU_NO_DERIVATIVES ? fmi2Discard : failed ? fmi2Error : fmi2OK;
}

#define INSTANCE(component) (((lag_component *)(component))->fmu)

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi2OK; /* errors are always reported */
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)token, (void)visible, (void)logging;
    return lag_component_make(name, resources, type == fmi2ModelExchange, log_message, NULL, callbacks);
}

void fmi2FreeInstance(fmi2Component c)
{
    lag_component_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)tolerance_defined, (void)tolerance; /* that of the model holds */
    return status_of(lag_fmu_initialize(INSTANCE(c), start, stop_defined ? stop : INFINITY));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return status_of(lag_fmu_begin(INSTANCE(c)));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    lag_fmu_reset(INSTANCE(c));
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    return status_of(lag_fmu_get(INSTANCE(c), references, count, values));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    return status_of(lag_fmu_set(INSTANCE(c), references, count, values));
}

/* There are no variables of other types. */
#define NO_VARIABLES(type)                                                                                            \
    fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference references[], size_t count,                    \
                             fmi2##type values[])                                                                     \
    {                                                                                                                 \
        (void)c, (void)references, (void)values;                                                                      \
        return status_of(count > 0);                                                                                  \
    }                                                                                                                 \
    fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference references[], size_t count,                    \
                             const fmi2##type values[])                                                               \
    {                                                                                                                 \
        (void)c, (void)references, (void)values;                                                                      \
        return status_of(count > 0);                                                                                  \
    }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status_of(lag_component_save(c, state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return status_of(!state || lag_fmu_restore(INSTANCE(c), state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    lag_fmu_forget(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c;
    lag_fmu_bytes_of(state, size);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return status_of(lag_component_serialize(c, state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return status_of(lag_component_deserialize(c, bytes, size, state));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
                                        fmi2Real changes[])
{
    return status_of(lag_fmu_directional(INSTANCE(c), unknowns, unknown_count, knowns, known_count, seed, changes));
}

/* What modelDescription.xml says is not available. */
#define UNAVAILABLE(name, ...) LAG_ALWAYS(fmi2Status, fmi2Error, name, __VA_ARGS__)
/* States of a step that is under way, which steps never are. */
#define NO_STATUS(name, type) LAG_ALWAYS(fmi2Status, fmi2Discard, name, const fmi2StatusKind kind, type *value)
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
UNAVAILABLE(fmi2SetRealInputDerivatives, const fmi2ValueReference references[], size_t count,
            const fmi2Integer orders[], const fmi2Real values[])
UNAVAILABLE(fmi2GetRealOutputDerivatives, const fmi2ValueReference references[], size_t count,
            const fmi2Integer orders[], fmi2Real values[])
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetStringStatus, fmi2String)
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/* Co-simulation */

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real step, fmi2Boolean no_return)
{
    lag_fmu *fmu = INSTANCE(c);
    (void)no_return;
    if (lag_fmu_advance(fmu, t, t + step))
        return fmi2Error;
    return fmu->phase == LAG_FMU_ENDED ? fmi2Discard : fmi2OK; /* an event has ended the simulation */
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = lag_fmu_time(INSTANCE(c));
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = INSTANCE(c)->phase == LAG_FMU_ENDED;
    return fmi2OK;
}

/* Model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    const int moved = lag_fmu_drifted(INSTANCE(c));
    *info = (fmi2EventInfo){.values_changed = moved};
    return status_of(moved && lag_fmu_project(INSTANCE(c)));
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_return, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate)
{
    (void)no_return;
    *enter_event_mode = lag_fmu_drifted(INSTANCE(c));
    *terminate = 0;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t)
{
    lag_fmu_move(INSTANCE(c), t, NULL);
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t count)
{
    lag_fmu *fmu = INSTANCE(c);
    if (count != 2 * (size_t)fmu->nq)
        return fmi2Error;
    lag_fmu_move(fmu, lag_fmu_time(fmu), x);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t count)
{
    return status_of(count != 2 * (size_t)INSTANCE(c)->nq || lag_fmu_derivatives(INSTANCE(c), derivatives));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t count)
{
    (void)c, (void)indicators;
    return status_of(count > 0);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t count)
{
    return status_of(lag_fmu_state_of(INSTANCE(c), x, count));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t count)
{
    (void)c;
    for (size_t i = 0; i < count; ++i)
        nominals[i] = 1.0;
    return fmi2OK;
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
