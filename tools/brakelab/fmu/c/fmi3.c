/* Functions of FMI 3.0.2 for co-simulation, after the standard's chapters 2.2, 2.3 and 4.2.
 *
 * A call at the wrong time, an unknown variable, a wrong number of values: fmi3Error with a message, and the
 * instance is terminated, as chapter 2.3.2 asks for. A step of another length or from another time:
 * fmi3Discard, nothing has changed.
 */

static void deliver(instance *of, int status, const char *category, const char *message) {
    ((void (*)(void *, int, const char *, const char *))of->log)(of->environment, status, category, message);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3SetDebugLogging(instance *of, bool on, size_t count, const char *const categories[]) {
    return of ? choose_messages(of, on, count, categories) : ERROR;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool event_mode, bool early_return,
                                         const reference intermediate[], size_t count, void *environment,
                                         void (*log)(void), void *update) {
    (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)count, (void)update;
    instance *of = instantiate(name, token, environment, log, logging);
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

static int miscounted(instance *of, const char *function, size_t count, size_t n, const void *variables,
                      const void *values) {
    if (count != n) return tell(of, ERROR, "%s: %zu values of %zu variables", function, n, count);
    return incomplete(of, function, count, variables, values);
}

EXPORT int fmi3GetFloat64(instance *of, const reference variables[], size_t count, double values[], size_t n) {
    if (!of || miscounted(of, __func__, count, n, variables, values)) return ERROR;
    return get_numbers(of, __func__, variables, count, values);
}

EXPORT int fmi3SetFloat64(instance *of, const reference variables[], size_t count, const double values[], size_t n) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__)) return ERROR;
    if (miscounted(of, __func__, count, n, variables, values)) return ERROR;
    return set_numbers(of, __func__, variables, count, values);
}

EXPORT int fmi3GetBoolean(instance *of, const reference variables[], size_t count, bool values[], size_t n) {
    if (!of || miscounted(of, __func__, count, n, variables, values)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], false, true)) return ERROR;
        values[i] = *truth(of, variables[i]) != 0;
    }
    return OK;
}

EXPORT int fmi3SetBoolean(instance *of, const reference variables[], size_t count, const bool values[], size_t n) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__)) return ERROR;
    if (miscounted(of, __func__, count, n, variables, values)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], true, true)) return ERROR;
        *truth(of, variables[i]) = values[i];
    }
    return OK;
}

EXPORT int fmi3DoStep(instance *of, double at, double by, bool no_state_before, bool *event, bool *terminate,
                      bool *early, double *reached) {
    (void)no_state_before;
    if (refused(of, STEPPING, __func__)) return ERROR;
    int status = advance(of, at, by);
    if (event) *event = false;
    if (early) *early = false;
    if (terminate) *terminate = of->now.script_ended != 0;
    if (reached) *reached = time_of(&of->now);
    return status;
}

EXPORT int fmi3GetFMUState(instance *of, void **state) { return of ? keep(of, state) : ERROR; }

EXPORT int fmi3SetFMUState(instance *of, void *state) { return of ? restore(of, state) : ERROR; }

EXPORT int fmi3FreeFMUState(instance *of, void **state) {
    (void)of;
    return drop(state);
}

EXPORT int fmi3SerializedFMUStateSize(instance *of, void *state, size_t *size) {
    (void)state;
    return state_size(of, __func__, size);
}

EXPORT int fmi3SerializeFMUState(instance *of, void *state, unsigned char bytes[], size_t size) {
    return of ? serialise(of, state, bytes, size) : ERROR;
}

EXPORT int fmi3DeserializeFMUState(instance *of, const unsigned char bytes[], size_t size, void **state) {
    return of ? deserialise(of, bytes, size, state) : ERROR;
}

/* What every library has to export, and this one has no use for (chapter 2.5). */
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
