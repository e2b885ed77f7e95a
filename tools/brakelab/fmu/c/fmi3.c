/* Functions of FMI 3.0.2 for co-simulation, after the standard's chapters 2.2, 2.3 and 4.2.
 *
 * A call at the wrong time, an unknown variable, a wrong number of values: fmi3Error with a message, and the
 * instance is terminated, as chapter 2.3.2 asks for. A step of another length or from another time:
 * fmi3Discard, nothing has changed.
 */
#define EXPORT __attribute__((visibility("default")))
typedef uint32_t reference;

static int refused(instance *of, int phases, const char *function) {
    if (!of) return ERROR;
    if (of->now.phase & phases) return OK;
    const char *in = of->now.phase == INSTANTIATED   ? "before initialisation"
                     : of->now.phase == INITIALISING ? "during initialisation"
                     : of->now.phase == STEPPING     ? "between steps"
                                                     : "after the end, or an error";
    return tell(of, ERROR, "%s: not %s", function, in);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3SetDebugLogging(instance *of, bool on, size_t count, const char *const categories[]) {
    if (!of) return ERROR;
    unsigned chosen = count ? 0 : ~0u;
    for (size_t i = 0; i < count; i++) {
        unsigned known = 0;
        for (int status = WARNING; status <= ERROR; status++)
            if (categories[i] && !strcmp(categories[i], CATEGORIES[status])) known = 1u << status;
        if (!known) return tell(of, ERROR, "fmi3SetDebugLogging: no category %s", categories[i] ? categories[i] : "");
        chosen |= known;
    }
    of->logged = on ? of->logged | chosen : of->logged & ~chosen;
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool event_mode, bool early_return,
                                         const reference intermediate[], size_t count, void *environment,
                                         logger *log, void *update) {
    (void)name, (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)count, (void)update;
    instance *of = instantiate(token, environment, log, logging);
    if (of && event_mode) tell(of, WARNING, "there is no event mode; events are handled within a step");
    return of;
}

EXPORT void fmi3FreeInstance(instance *of) { discard(of); }

EXPORT int fmi3EnterInitializationMode(instance *of, bool tolerance_given, double tolerance, double start,
                                       bool stop_given, double stop) {
    (void)tolerance_given, (void)tolerance;
    if (refused(of, INSTANTIATED, __func__)) return ERROR;
    return initialise(of, start, stop_given ? stop : INFINITY);
}

EXPORT int fmi3ExitInitializationMode(instance *of) {
    if (refused(of, INITIALISING, __func__)) return ERROR;
    of->now.phase = STEPPING;
    return OK;
}

EXPORT int fmi3Terminate(instance *of) {
    if (refused(of, INITIALISING | STEPPING, __func__)) return ERROR;
    of->now.phase = ENDED;
    return OK;
}

EXPORT int fmi3Reset(instance *of) {
    if (!of) return ERROR;
    restart(of);
    return OK;
}

/* Return whether `variable` can be set now, or read, as a number or as a truth value. */
static int misused(instance *of, const char *function, reference variable, bool sets, bool truth) {
    if (variable >= COUNT) return tell(of, ERROR, "%s: no variable %u, the last is %d", function, variable, COUNT - 1);
    int kind = VARIABLES[variable].kind;
    if ((kind == PARAMETER) != truth)
        return tell(of, ERROR, "%s: variable %u is %s", function, variable, truth ? "a number" : "a truth value");
    if (sets && kind != INPUT && !(kind == PARAMETER && of->now.phase != STEPPING))
        return tell(of, ERROR, "%s: variable %u cannot be set%s", function, variable,
                    kind == PARAMETER ? " any more" : "");
    return OK;
}

static int miscounted(instance *of, const char *function, size_t variables, size_t values) {
    if (variables == values) return OK;
    return tell(of, ERROR, "%s: %zu values of %zu variables", function, values, variables);
}

EXPORT int fmi3GetFloat64(instance *of, const reference variables[], size_t count, double values[], size_t n) {
    if (!of || miscounted(of, __func__, count, n)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], false, false)) return ERROR;
        values[i] = VARIABLES[variables[i]].kind == TIME ? time_of(&of->now) : *number(of, variables[i]);
    }
    return OK;
}

EXPORT int fmi3SetFloat64(instance *of, const reference variables[], size_t count, const double values[], size_t n) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__) || miscounted(of, __func__, count, n))
        return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], true, false)) return ERROR;
        *number(of, variables[i]) = values[i];
    }
    return OK;
}

EXPORT int fmi3GetBoolean(instance *of, const reference variables[], size_t count, bool values[], size_t n) {
    if (!of || miscounted(of, __func__, count, n)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], false, true)) return ERROR;
        values[i] = of->now.memory[VARIABLES[variables[i]].offset] != 0;
    }
    return OK;
}

EXPORT int fmi3SetBoolean(instance *of, const reference variables[], size_t count, const bool values[], size_t n) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__) || miscounted(of, __func__, count, n))
        return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], true, true)) return ERROR;
        of->now.memory[VARIABLES[variables[i]].offset] = values[i];
    }
    return OK;
}

EXPORT int fmi3DoStep(instance *of, double at, double by, bool no_state_before, bool *event, bool *terminate,
                      bool *early, double *reached) {
    (void)no_state_before;
    if (refused(of, STEPPING, __func__)) return ERROR;
    int status = advance(of, at, by);
    *event = *early = false;
    *terminate = of->now.script_ended != 0;
    *reached = time_of(&of->now);
    return status;
}

EXPORT int fmi3GetFMUState(instance *of, void **state) {
    if (!of || !state) return ERROR;
    return keep(of, state);
}

EXPORT int fmi3SetFMUState(instance *of, void *state) {
    if (!of) return ERROR;
    if (!state || memcmp(state, TOKEN, sizeof TOKEN)) return tell(of, ERROR, "%s: no state of this FMU", __func__);
    memcpy(&of->now, state, sizeof of->now);
    return OK;
}

EXPORT int fmi3FreeFMUState(instance *of, void **state) {
    (void)of;
    if (state) free(*state), *state = NULL;
    return OK;
}

EXPORT int fmi3SerializedFMUStateSize(instance *of, void *state, size_t *size) {
    (void)of, (void)state;
    *size = sizeof(snapshot);
    return OK;
}

EXPORT int fmi3SerializeFMUState(instance *of, void *state, unsigned char bytes[], size_t size) {
    if (!of) return ERROR;
    if (!state || size < sizeof(snapshot))
        return tell(of, ERROR, "%s: %zu bytes for a state of %zu", __func__, size, sizeof(snapshot));
    memcpy(bytes, state, sizeof(snapshot));
    return OK;
}

EXPORT int fmi3DeserializeFMUState(instance *of, const unsigned char bytes[], size_t size, void **state) {
    if (!of || !state) return ERROR;
    return deserialise(of, bytes, size, state);
}

/* What every library has to export, and this one has no use for (chapter 2.5). */
#define NONE_OF_THIS_TYPE(name)                                                                                  \
    EXPORT int name(instance *of, const reference variables[], size_t count) {                                   \
        (void)variables;                                                                                         \
        if (!of) return ERROR;                                                                                   \
        return count ? tell(of, ERROR, "%s: no variable is of this type", __func__) : OK;                        \
    }
#define NOT_PROVIDED(name)                                                                                       \
    EXPORT int name(instance *of) { return of ? tell(of, ERROR, "%s: not provided", __func__) : ERROR; }

#define FOR_BOTH(of, type) of(fmi3Get##type) of(fmi3Set##type)
FOR_BOTH(NONE_OF_THIS_TYPE, Float32)
FOR_BOTH(NONE_OF_THIS_TYPE, Int8)
FOR_BOTH(NONE_OF_THIS_TYPE, UInt8)
FOR_BOTH(NONE_OF_THIS_TYPE, Int16)
FOR_BOTH(NONE_OF_THIS_TYPE, UInt16)
FOR_BOTH(NONE_OF_THIS_TYPE, Int32)
FOR_BOTH(NONE_OF_THIS_TYPE, UInt32)
FOR_BOTH(NONE_OF_THIS_TYPE, Int64)
FOR_BOTH(NONE_OF_THIS_TYPE, UInt64)
FOR_BOTH(NONE_OF_THIS_TYPE, String)
FOR_BOTH(NONE_OF_THIS_TYPE, Binary)
FOR_BOTH(NONE_OF_THIS_TYPE, Clock)
FOR_BOTH(NOT_PROVIDED, IntervalDecimal)
FOR_BOTH(NOT_PROVIDED, IntervalFraction)
FOR_BOTH(NOT_PROVIDED, ShiftDecimal)
FOR_BOTH(NOT_PROVIDED, ShiftFraction)
NOT_PROVIDED(fmi3GetNumberOfVariableDependencies)
NOT_PROVIDED(fmi3GetVariableDependencies)
NOT_PROVIDED(fmi3GetDirectionalDerivative)
NOT_PROVIDED(fmi3GetAdjointDerivative)
NOT_PROVIDED(fmi3GetOutputDerivatives)
NOT_PROVIDED(fmi3EnterConfigurationMode)
NOT_PROVIDED(fmi3ExitConfigurationMode)
NOT_PROVIDED(fmi3EnterEventMode)
NOT_PROVIDED(fmi3EnterStepMode)
NOT_PROVIDED(fmi3EvaluateDiscreteStates)
NOT_PROVIDED(fmi3UpdateDiscreteStates)
NOT_PROVIDED(fmi3EnterContinuousTimeMode)
NOT_PROVIDED(fmi3CompletedIntegratorStep)
NOT_PROVIDED(fmi3SetTime)
NOT_PROVIDED(fmi3SetContinuousStates)
NOT_PROVIDED(fmi3GetContinuousStates)
NOT_PROVIDED(fmi3GetContinuousStateDerivatives)
NOT_PROVIDED(fmi3GetNominalsOfContinuousStates)
NOT_PROVIDED(fmi3GetNumberOfContinuousStates)
NOT_PROVIDED(fmi3GetEventIndicators)
NOT_PROVIDED(fmi3GetNumberOfEventIndicators)
NOT_PROVIDED(fmi3ActivateModelPartition)
EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
