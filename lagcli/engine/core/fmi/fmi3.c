/* The functions of FMI 3.0.2 (https://fmi-standard.org): co-simulation and model exchange. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "fmi/component.h"
#include "fmi/directional.h"

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef unsigned fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef void fmi3LogMessageCallback(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                                    fmi3String message);
typedef void fmi3ClockUpdateCallback(fmi3InstanceEnvironment environment);
typedef void fmi3IntermediateUpdateCallback(fmi3InstanceEnvironment environment, fmi3Float64 t, fmi3Boolean set,
                                            fmi3Boolean get, fmi3Boolean finished, fmi3Boolean may_return,
                                            fmi3Boolean *early, fmi3Float64 *early_time);
typedef void fmi3LockPreemptionCallback(void);
typedef void fmi3UnlockPreemptionCallback(void);

/* An instance with the importing tool's callbacks, which are those of the component, too. */
typedef struct {
    fmi3LogMessageCallback *log;
    fmi3IntermediateUpdateCallback *update;
    lag_component *component;
} lag_fmi3;

static void log_message(void *context, const char *text)
{
    const lag_component *c = context;
    const lag_fmi3 *own = c->callbacks;
    if (own->log)
        own->log(c->environment, fmi3Error, "logStatusError", text);
}

static double intermediate_update(void *context, double t)
{
    const lag_component *c = context;
    const lag_fmi3 *own = c->callbacks;
    fmi3Boolean early = false;
    fmi3Float64 end = t;
    own->update(c->environment, t, false, true, true, c->fmu->may_return, &early, &end);
    return early ? end : INFINITY;
}

static fmi3Status status_of(int failed)
{
    return failed == LAG_FMU_NO_DERIVATIVES ? fmi3Discard : failed ? fmi3Error : fmi3OK;
}

#define COMPONENT(instance) (((lag_fmi3 *)(instance))->component)
#define INSTANCE(instance) (COMPONENT(instance)->fmu)

static fmi3Instance make(fmi3String name, fmi3String resources, int exchange, fmi3InstanceEnvironment environment,
                         fmi3LogMessageCallback *log)
{
    lag_fmi3 *made = calloc(1, sizeof *made);
    if (!made)
        return NULL;
    made->log = log;
    made->component = lag_component_make(name, resources, exchange, log_message, environment, made);
    if (!made->component) {
        free(made);
        return NULL;
    }
    return made;
}

#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

const char *fmi3GetVersion(void)
{
    return "3.0";
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi3OK; /* errors are always reported */
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback *log)
{
    (void)token, (void)visible, (void)logging;
    return make(name, resources, 1, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback *log,
                                         fmi3IntermediateUpdateCallback *update)
{
    (void)token, (void)visible, (void)logging, (void)intermediate, (void)count; /* all values can be had */
    lag_fmi3 *made = make(name, resources, 0, environment, log);
    if (!made)
        return NULL;
    lag_fmu *fmu = made->component->fmu;
    fmu->has_event_mode = event_mode;
    fmu->may_return = early_return;
    made->update = update;
    fmu->update = update ? intermediate_update : NULL;
    return made;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback *log,
                                               fmi3ClockUpdateCallback *update, fmi3LockPreemptionCallback *lock,
                                               fmi3UnlockPreemptionCallback *unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL; /* not available */
}

void fmi3FreeInstance(fmi3Instance c)
{
    if (!c)
        return;
    lag_component_free(COMPONENT(c));
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    (void)tolerance_defined, (void)tolerance; /* that of the model holds */
    return status_of(lag_fmu_initialize(INSTANCE(c), start, stop_defined ? stop : INFINITY));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return status_of(lag_fmu_begin(INSTANCE(c)));
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    lag_fmu_reset(INSTANCE(c));
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count)
{
    return status_of(value_count != count || lag_fmu_get(INSTANCE(c), references, count, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count)
{
    return status_of(value_count != count || lag_fmu_set(INSTANCE(c), references, count, values));
}

/* There are no variables of other types. */
#define NO_VARIABLES(type)                                                                                            \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference references[], size_t count,                     \
                             fmi3##type values[], size_t value_count)                                                 \
    {                                                                                                                 \
        (void)c, (void)references, (void)values, (void)value_count;                                                   \
        return status_of(count > 0);                                                                                  \
    }                                                                                                                 \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference references[], size_t count,                     \
                             const fmi3##type values[], size_t value_count)                                           \
    {                                                                                                                 \
        (void)c, (void)references, (void)values, (void)value_count;                                                   \
        return status_of(count > 0);                                                                                  \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t value_count)
{
    (void)c, (void)references, (void)sizes, (void)values, (void)value_count;
    return status_of(count > 0);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t count, const size_t sizes[],
                         const fmi3Binary values[], size_t value_count)
{
    (void)c, (void)references, (void)sizes, (void)values, (void)value_count;
    return status_of(count > 0);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Clock values[])
{
    (void)c, (void)references, (void)values;
    return status_of(count > 0);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Clock values[])
{
    (void)c, (void)references, (void)values;
    return status_of(count > 0);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return status_of(lag_component_save(COMPONENT(c), state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    return status_of(!state || lag_fmu_restore(INSTANCE(c), state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    lag_fmu_forget(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)c;
    lag_fmu_bytes_of(state, size);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return status_of(lag_component_serialize(COMPONENT(c), state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return status_of(lag_component_deserialize(COMPONENT(c), bytes, size, state));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
                                        const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                        size_t seed_count, fmi3Float64 changes[], size_t change_count)
{
    if (seed_count != known_count || change_count != unknown_count)
        return fmi3Error;
    return status_of(lag_fmu_directional(INSTANCE(c), unknowns, unknown_count, knowns, known_count, seed, changes));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
                                    const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                    size_t seed_count, fmi3Float64 changes[], size_t change_count)
{
    if (seed_count != unknown_count || change_count != known_count)
        return fmi3Error;
    return status_of(lag_fmu_adjoint(INSTANCE(c), unknowns, unknown_count, knowns, known_count, seed, changes));
}

/* Functions without effect: of modes that need none. */
#define NOTHING(name)                                                                                                 \
    fmi3Status name(fmi3Instance c)                                                                                   \
    {                                                                                                                 \
        (void)c;                                                                                                      \
        return fmi3OK;                                                                                                \
    }
NOTHING(fmi3EnterEventMode)
NOTHING(fmi3Terminate)
NOTHING(fmi3EnterConfigurationMode)
NOTHING(fmi3ExitConfigurationMode)
NOTHING(fmi3EvaluateDiscreteStates)
NOTHING(fmi3EnterContinuousTimeMode)
NOTHING(fmi3EnterStepMode)

/* Functions of what modelDescription.xml does not declare. */
#define UNAVAILABLE(name, ...) LAG_ALWAYS(fmi3Status, fmi3Error, name, __VA_ARGS__)
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
UNAVAILABLE(fmi3GetNumberOfVariableDependencies, fmi3ValueReference reference, size_t *count)
UNAVAILABLE(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t element_indices[],
            fmi3ValueReference independents[], size_t independent_indices[], fmi3DependencyKind kinds[], size_t count)
UNAVAILABLE(fmi3GetIntervalDecimal, const fmi3ValueReference references[], size_t count, fmi3Float64 intervals[],
            fmi3IntervalQualifier qualifiers[])
UNAVAILABLE(fmi3GetIntervalFraction, const fmi3ValueReference references[], size_t count, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
UNAVAILABLE(fmi3GetShiftDecimal, const fmi3ValueReference references[], size_t count, fmi3Float64 shifts[])
UNAVAILABLE(fmi3GetShiftFraction, const fmi3ValueReference references[], size_t count, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3SetIntervalDecimal, const fmi3ValueReference references[], size_t count, const fmi3Float64 intervals[])
UNAVAILABLE(fmi3SetIntervalFraction, const fmi3ValueReference references[], size_t count, const fmi3UInt64 counters[],
            const fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3SetShiftDecimal, const fmi3ValueReference references[], size_t count, const fmi3Float64 shifts[])
UNAVAILABLE(fmi3SetShiftFraction, const fmi3ValueReference references[], size_t count, const fmi3UInt64 counters[],
            const fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3GetOutputDerivatives, const fmi3ValueReference references[], size_t count, const fmi3Int32 orders[],
            fmi3Float64 values[], size_t value_count)
UNAVAILABLE(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 t)
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/* Co-simulation */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 step, fmi3Boolean no_return,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time)
{
    lag_fmu *fmu = INSTANCE(c);
    (void)no_return;
    const int failed = lag_fmu_advance(fmu, t, t + step);
    *event_handling_needed = lag_fmu_is_due(fmu);
    *terminate = fmu->phase == LAG_FMU_ENDED; /* by an event */
    *last_time = lag_fmu_time(fmu);
    *early_return = fmu->may_return && *last_time < t + step;
    return status_of(failed);
}

/* Events */

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needed, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_time_defined, fmi3Float64 *next_event_time)
{
    lag_fmu *fmu = INSTANCE(c);
    *needed = *terminate = *nominals_changed = *values_changed = *next_event_time_defined = false;
    *next_event_time = INFINITY;
    if (fmu->exchange) {
        *values_changed = lag_fmu_drifted(fmu);
        return status_of(*values_changed && lag_fmu_project(fmu));
    }
    const int failed = lag_fmu_happen(fmu, next_event_time);
    *terminate = fmu->phase == LAG_FMU_ENDED;
    *next_event_time_defined = isfinite(*next_event_time);
    return status_of(failed);
}

/* Model exchange */

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_return, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate)
{
    (void)no_return;
    *enter_event_mode = lag_fmu_drifted(INSTANCE(c));
    *terminate = false;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 t)
{
    lag_fmu_move(INSTANCE(c), t, NULL);
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t count)
{
    lag_fmu *fmu = INSTANCE(c);
    if (count != 2 * (size_t)fmu->nq)
        return fmi3Error;
    lag_fmu_move(fmu, lag_fmu_time(fmu), x);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t count)
{
    return status_of(count != 2 * (size_t)INSTANCE(c)->nq || lag_fmu_derivatives(INSTANCE(c), derivatives));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t count)
{
    (void)c, (void)indicators;
    return status_of(count > 0);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t count)
{
    return status_of(lag_fmu_state_of(INSTANCE(c), x, count));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t count)
{
    (void)c;
    for (size_t i = 0; i < count; ++i)
        nominals[i] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count)
{
    (void)c;
    *count = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count)
{
    *count = INSTANCE(c)->exchange ? 2 * (size_t)INSTANCE(c)->nq : 0;
    return fmi3OK;
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
