/* Functions of FMI 2.0.3 for co-simulation, after the standard's chapters 2.1 and 4.2; what is wrong is as in fmi3.c.
 *
 * A scenario that has ended: fmi2Discard, and fmi2Terminated is true.
 */
typedef struct {
    void (*log)(void);
    void *allocate, *release, *finished, *environment;
} callbacks;

static void deliver(instance *of, int status, const char *category, const char *message) {
    ((void (*)(void *, const char *, int, const char *, const char *, ...))of->log)(
        of->environment, of->name, status, category, "%s", message);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(instance *of, int on, size_t count, const char *const categories[]) {
    return of ? choose_messages(of, on != 0, count, categories) : ERROR;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                             const callbacks *given, int visible, int logging) {
    (void)resources, (void)visible;
    if (type != 1) return NULL; /* co-simulation */
    return instantiate(name, token, given ? given->environment : NULL, given ? given->log : NULL, logging != 0);
}

EXPORT void fmi2FreeInstance(instance *of) { discard(of); }

EXPORT int fmi2SetupExperiment(instance *of, int tolerance_given, double tolerance, double start, int stop_given,
                               double stop) {
    (void)tolerance_given, (void)tolerance;
    if (refused(of, INSTANTIATED, __func__)) return ERROR;
    of->now.start = start, of->now.stop = stop_given ? stop : INFINITY;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(instance *of) {
    if (refused(of, INSTANTIATED, __func__)) return ERROR;
    return initialise(of, of->now.start, of->now.stop);
}

EXPORT int fmi2ExitInitializationMode(instance *of) {
    if (refused(of, INITIALISING, __func__)) return ERROR;
    of->now.phase = STEPPING;
    return OK;
}

EXPORT int fmi2Terminate(instance *of) {
    if (refused(of, STEPPING, __func__)) return ERROR;
    of->now.phase = ENDED;
    return OK;
}

EXPORT int fmi2Reset(instance *of) {
    if (!of) return ERROR;
    restart(of);
    return OK;
}

EXPORT int fmi2GetReal(instance *of, const reference variables[], size_t count, double values[]) {
    if (!of || incomplete(of, __func__, count, variables, values)) return ERROR;
    return get_numbers(of, __func__, variables, count, values);
}

EXPORT int fmi2SetReal(instance *of, const reference variables[], size_t count, const double values[]) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__)) return ERROR;
    if (incomplete(of, __func__, count, variables, values)) return ERROR;
    return set_numbers(of, __func__, variables, count, values);
}

EXPORT int fmi2GetBoolean(instance *of, const reference variables[], size_t count, int values[]) {
    if (!of || incomplete(of, __func__, count, variables, values)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], false, true)) return ERROR;
        values[i] = *truth(of, variables[i]) != 0;
    }
    return OK;
}

EXPORT int fmi2SetBoolean(instance *of, const reference variables[], size_t count, const int values[]) {
    if (refused(of, INSTANTIATED | INITIALISING | STEPPING, __func__)) return ERROR;
    if (incomplete(of, __func__, count, variables, values)) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (misused(of, __func__, variables[i], true, true)) return ERROR;
        *truth(of, variables[i]) = values[i] != 0;
    }
    return OK;
}

EXPORT int fmi2DoStep(instance *of, double at, double by, int no_state_before) {
    (void)no_state_before;
    if (refused(of, STEPPING, __func__)) return ERROR;
    int status = advance(of, at, by);
    return status == OK && of->now.script_ended ? DISCARD : status;
}

EXPORT int fmi2GetRealStatus(instance *of, int kind, double *value) {
    if (!of || kind != 2) return of ? DISCARD : ERROR; /* fmi2LastSuccessfulTime */
    *value = time_of(&of->now);
    return OK;
}

EXPORT int fmi2GetBooleanStatus(instance *of, int kind, int *value) {
    if (!of || kind != 3) return of ? DISCARD : ERROR; /* fmi2Terminated */
    *value = of->now.script_ended != 0;
    return OK;
}

EXPORT int fmi2GetFMUstate(instance *of, void **state) { return of ? keep(of, state) : ERROR; }

EXPORT int fmi2SetFMUstate(instance *of, void *state) { return of ? restore(of, state) : ERROR; }

EXPORT int fmi2FreeFMUstate(instance *of, void **state) {
    (void)of;
    return drop(state);
}

EXPORT int fmi2SerializedFMUstateSize(instance *of, void *state, size_t *size) {
    (void)state;
    return state_size(of, __func__, size);
}

EXPORT int fmi2SerializeFMUstate(instance *of, void *state, unsigned char bytes[], size_t size) {
    return of ? serialise(of, state, bytes, size) : ERROR;
}

EXPORT int fmi2DeSerializeFMUstate(instance *of, const unsigned char bytes[], size_t size, void **state) {
    return of ? deserialise(of, bytes, size, state) : ERROR;
}

/* What every library for co-simulation has to export, and this one has no use for. */
NONE_OF_THIS_TYPE(fmi2GetInteger)
NONE_OF_THIS_TYPE(fmi2SetInteger)
NONE_OF_THIS_TYPE(fmi2GetString)
NONE_OF_THIS_TYPE(fmi2SetString)
NOT_PROVIDED(fmi2GetDirectionalDerivative)
NOT_PROVIDED(fmi2SetRealInputDerivatives)
NOT_PROVIDED(fmi2GetRealOutputDerivatives)
NOT_PROVIDED(fmi2CancelStep)
EXPORT int fmi2GetStatus(instance *of) { return of ? DISCARD : ERROR; }
EXPORT int fmi2GetIntegerStatus(instance *of) { return of ? DISCARD : ERROR; }
EXPORT int fmi2GetStringStatus(instance *of) { return of ? DISCARD : ERROR; }
