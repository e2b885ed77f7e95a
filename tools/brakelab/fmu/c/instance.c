/* One instance of an FMU: its memory, calls of compiled kernels, messages, states.
 *
 * The tables above this text (brakelab/fmu/source.py) say what the memory holds at the start, where in it each
 * variable lies, and with what each kernel is called. All of an instance is in its memory, so that a state is a
 * copy of it. Nothing is shared by instances, and after instantiation nothing is allocated but states.
 */
enum phase { INSTANTIATED = 1, INITIALISING = 2, STEPPING = 4, ENDED = 8 };
enum status { OK, WARNING, DISCARD, ERROR };
#define LONGEST_S 3600.5 /* of a step */

typedef int kernel(int64_t *places);
typedef uint32_t reference;

typedef struct {
    char token[sizeof TOKEN];
    int32_t phase, script_ended;
    int64_t cycle; /* steps since the start */
    double start, stop;
    _Alignas(64) unsigned char memory[MEMORY];
} snapshot;

typedef struct {
    snapshot now;
    int64_t places[CALLS][MOST_PLACES];
    kernel *kernels[CALLS];
    void *library, *environment;
    void (*log)(void); /* of a type that the version of FMI says */
    unsigned logged;   /* a bit for each status */
    char name[100];
} instance;

/* Hand a message to the importer, in fmi2.c or fmi3.c. */
static void deliver(instance *of, int status, const char *category, const char *message);

static const char *const CATEGORIES[] = {"", "logStatusWarning", "logStatusDiscard", "logStatusError"};

/* Return `status` after its message; an error ends the run, as FMI has it. */
__attribute__((format(printf, 3, 4))) static int tell(instance *of, int status, const char *format, ...) {
    if (of->log && (status == ERROR || of->logged >> status & 1)) {
        char text[400];
        va_list values;
        va_start(values, format);
        vsnprintf(text, sizeof text, format, values);
        va_end(values);
        deliver(of, status, CATEGORIES[status], text);
    }
    if (status == ERROR) of->now.phase = ENDED;
    return status;
}

static double *number(instance *of, uint32_t variable) {
    return (double *)(of->now.memory + VARIABLES[variable].offset);
}

/* Noise: PCG XSL RR 128/64 (M. E. O'Neill, HMC-CS-2014-0905), the sequence of numpy's PCG64. */
typedef struct {
    uint64_t state[2], step[2]; /* low half first */
    uint64_t kept, value;       /* the other half of a number handed out in halves */
} noise;

static uint64_t next_64(void *of) {
    noise *n = of;
    const unsigned __int128 factor = (unsigned __int128)0x2360ED051FC65DA4u << 64 | 0x4385DF649FCCF645u;
    unsigned __int128 state = (unsigned __int128)n->state[1] << 64 | n->state[0];
    state = state * factor + ((unsigned __int128)n->step[1] << 64 | n->step[0]);
    n->state[0] = (uint64_t)state, n->state[1] = (uint64_t)(state >> 64);
    uint64_t folded = n->state[0] ^ n->state[1];
    unsigned turn = (unsigned)(state >> 122);
    return folded >> turn | folded << (-turn & 63);
}

static uint32_t next_32(void *of) {
    noise *n = of;
    if (n->kept) {
        n->kept = 0;
        return (uint32_t)n->value;
    }
    uint64_t whole = next_64(of);
    n->kept = 1, n->value = whole >> 32;
    return (uint32_t)whole;
}

static double next_real(void *of) { return (double)(next_64(of) >> 11) * 0x1p-53; }

/* What a place of a call holds that is known at run time alone: -1 … -3, else an offset in the memory. */
static int64_t resolved(instance *of, int64_t target) {
    switch (target) {
    case -1: return (int64_t)(uintptr_t)next_64;
    case -2: return (int64_t)(uintptr_t)next_32;
    case -3: return (int64_t)(uintptr_t)next_real;
    default: return (int64_t)(uintptr_t)(of->now.memory + target);
    }
}

static int runs_here(const char *processor) {
#if defined __x86_64__
    if (!strcmp(processor, "x86-64-v3"))
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
               __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
#endif
    (void)processor;
    return 1;
}

enum { PATH_SIZE = 4096 };

/* Load the kernels for this processor from the folder that this library was loaded from. It is absolute: the importer
 * may have loaded the library by a relative path, and changed its working directory since. */
static int load(instance *of) {
    Dl_info here;
    void *own;
    char folder[2 * PATH_SIZE + 1]; /* working directory and relative path */
    if (!dladdr1((void *)load, &here, &own, RTLD_DL_LINKMAP) || strlen(here.dli_fname) >= PATH_SIZE ||
        dlinfo(own, RTLD_DI_ORIGIN, folder))
        return tell(of, ERROR, "the folder of the FMU's library is not known");
    for (size_t i = 0; i < sizeof LIBRARIES / sizeof *LIBRARIES; i++) {
        if (!runs_here(LIBRARIES[i].processor)) continue;
        char path[PATH_SIZE];
        int size = snprintf(path, sizeof path, "%s/%s", folder, LIBRARIES[i].file);
        if (size < 0 || size >= PATH_SIZE) return tell(of, ERROR, "the path of the FMU is too long");
        of->library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (!of->library) return tell(of, ERROR, "%s", dlerror());
        for (int call = 0; call < CALLS; call++) {
            void *found = dlsym(of->library, SYMBOLS[call]);
            if (!found) return tell(of, ERROR, "%s: no %s", path, SYMBOLS[call]);
            memcpy(&of->kernels[call], &found, sizeof found);
        }
        return OK;
    }
    return tell(of, ERROR, "the FMU holds no kernels for this processor, only for %s", LIBRARIES[0].processor);
}

static void restart(instance *of) {
    memset(&of->now, 0, sizeof of->now);
    memcpy(of->now.token, TOKEN, sizeof TOKEN);
    memcpy(of->now.memory, START, MEMORY);
    of->now.phase = INSTANTIATED, of->now.stop = INFINITY;
}

static void discard(instance *of) {
    if (of && of->library) dlclose(of->library);
    free(of);
}

static instance *instantiate(const char *name, const char *token, void *environment, void (*log)(void),
                             bool logging) {
    instance *of = aligned_alloc(64, (sizeof *of + 63) / 64 * 64);
    if (!of) return NULL;
    memset(of, 0, sizeof *of);
    of->environment = environment, of->log = log, of->logged = logging ? ~0u : 0u;
    snprintf(of->name, sizeof of->name, "%s", name ? name : "");
    restart(of);
    int wrong = token && !strcmp(token, TOKEN) ? load(of) : tell(of, ERROR, "the token is another FMU's");
    if (wrong) {
        discard(of);
        return NULL;
    }
    for (int call = 0; call < CALLS; call++) memcpy(of->places[call], PLACES[call], sizeof *of->places);
    for (size_t i = 0; i < sizeof TARGETS / sizeof *TARGETS; i++)
        of->places[TARGETS[i].call][TARGETS[i].place] = resolved(of, TARGETS[i].target);
    return of;
}

/* Call a kernel; return 0, or 1 where it failed. */
static int run(instance *of, int call) { return of->kernels[call](of->places[call]) != 0; }

/* What the ECU or the vehicle does, in ecu.c or vehicle.c: at the start, and in a cycle from `t_ns` on, at the begin of
 * which there is a communication point or not. Return 0, or 1 where a kernel failed. */
static int begin_unit(instance *of);
static int step_unit(instance *of, int64_t t_ns, bool communicates);

static double time_of(const snapshot *now) { return now->start + (double)now->cycle * 1e-9 * CYCLE_NS; }

/* Kernels compare with NaN and round to nearest: an importer that traps or flushes has its own setting back. */
static int guarded(instance *of, int64_t cycles) {
    fenv_t theirs;
    fegetenv(&theirs);
    fesetenv(FE_DFL_ENV);
    int failed = cycles ? 0 : begin_unit(of);
    for (int64_t k = 0; k < cycles && !failed && !of->now.script_ended; k++)
        failed = step_unit(of, llround(of->now.start * 1e9) + (of->now.cycle + k) * CYCLE_NS, k == 0);
    fesetenv(&theirs);
    return failed ? tell(of, ERROR, "a kernel failed: an index or a shape") : OK;
}

static int initialise(instance *of, double start, double stop) {
    if (!(fabs(start) < 1e9)) return tell(of, ERROR, "start time %g s: give one of at most 1e9 s", start);
    of->now.start = start, of->now.stop = stop;
    of->now.phase = INITIALISING;
    return guarded(of, 0);
}

static int advance(instance *of, double at, double by) {
    double now = time_of(&of->now), cycle = 1e-9 * CYCLE_NS;
    int64_t cycles = by > 0.0 && by < LONGEST_S ? llround(by / cycle) : 0;
    if (by >= LONGEST_S) return tell(of, DISCARD, "a step of %g s: this FMU takes steps of 1 h at most", by);
    if (!cycles || !(fabs(by - (double)cycles * cycle) < 1e-6))
        return tell(of, DISCARD, "a step of %g s: this FMU takes steps of %g s, or multiples of it", by, cycle);
    if (!(fabs(at - now) < 0.1 * cycle))
        return tell(of, DISCARD, "a step from %.9g s: this FMU is at %.9g s", at, now);
    if (now + by > of->now.stop + 0.1 * cycle)
        return tell(of, ERROR, "a step to %.9g s: the stop time is %.9g s", now + by, of->now.stop);
    int ended = of->now.script_ended;
    int status = guarded(of, cycles);
    of->now.cycle += cycles;
    if (of->now.script_ended > ended) tell(of, WARNING, "the scenario has ended; values are held from here on");
    return status;
}

static bool is_own(const void *state) { return state && !memcmp(state, TOKEN, sizeof TOKEN); }

/* Write a state to `*state`: a new one, or over an older one of this FMU. */
static int hand_out(instance *of, const void *now, void **state) {
    if (!state || (*state && !is_own(*state))) return tell(of, ERROR, "no place for a state of this FMU is given");
    if (!*state && !(*state = aligned_alloc(64, sizeof(snapshot)))) return tell(of, ERROR, "no memory for a state");
    memcpy(*state, now, sizeof(snapshot));
    return OK;
}

static int keep(instance *of, void **state) { return hand_out(of, &of->now, state); }

static int restore(instance *of, const void *state) {
    if (!is_own(state)) return tell(of, ERROR, "no state of this FMU is given");
    memcpy(&of->now, state, sizeof of->now);
    return OK;
}

/* FNV-1a: a kernel that went on from damaged bytes would leave its memory. */
static uint64_t checksum(const unsigned char *bytes) {
    uint64_t sum = 0xCBF29CE484222325u;
    for (size_t i = 0; i < sizeof(snapshot); i++) sum = (sum ^ bytes[i]) * 0x100000001B3u;
    return sum;
}

enum { SERIALISED = sizeof(snapshot) + sizeof(uint64_t) };

static int serialise(instance *of, const void *state, unsigned char *bytes, size_t size) {
    if (!is_own(state)) return tell(of, ERROR, "no state of this FMU is given");
    if (!bytes || size < SERIALISED)
        return tell(of, ERROR, "%zu bytes for a state of %d", bytes ? size : 0, SERIALISED);
    memcpy(bytes, state, sizeof(snapshot));
    uint64_t sum = checksum(bytes);
    memcpy(bytes + sizeof(snapshot), &sum, sizeof sum);
    return OK;
}

static int deserialise(instance *of, const unsigned char *bytes, size_t size, void **state) {
    uint64_t sum = 0;
    if (bytes && size == SERIALISED) memcpy(&sum, bytes + sizeof(snapshot), sizeof sum);
    if (!bytes || size != SERIALISED || !is_own(bytes) || sum != checksum(bytes))
        return tell(of, ERROR, "not a state of this FMU, or damaged: %zu bytes, its own have %d", size, SERIALISED);
    return hand_out(of, bytes, state);
}

static int drop(void **state) {
    if (state) free(*state), *state = NULL;
    return OK;
}

/* What both versions of FMI check. */
static int refused(instance *of, int phases, const char *function) {
    if (!of) return ERROR;
    if (of->now.phase & phases) return OK;
    const char *in = of->now.phase == INSTANTIATED   ? "before initialisation"
                     : of->now.phase == INITIALISING ? "during initialisation"
                     : of->now.phase == STEPPING     ? "between steps"
                                                     : "after the end, or an error";
    return tell(of, ERROR, "%s: not %s", function, in);
}

/* Refuse a list without its arrays. */
static int incomplete(instance *of, const char *function, size_t count, const void *variables, const void *values) {
    if (!count || (variables && values)) return OK;
    return tell(of, ERROR, "%s: no array of %s", function, variables ? "values" : "variables");
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

static int get_numbers(instance *of, const char *function, const reference variables[], size_t count,
                       double values[]) {
    for (size_t i = 0; i < count; i++) {
        if (misused(of, function, variables[i], false, false)) return ERROR;
        values[i] = VARIABLES[variables[i]].kind == TIME ? time_of(&of->now) : *number(of, variables[i]);
    }
    return OK;
}

static int set_numbers(instance *of, const char *function, const reference variables[], size_t count,
                       const double values[]) {
    for (size_t i = 0; i < count; i++) {
        if (misused(of, function, variables[i], true, false)) return ERROR;
        *number(of, variables[i]) = values[i];
    }
    return OK;
}

static unsigned char *truth(instance *of, uint32_t variable) { return of->now.memory + VARIABLES[variable].offset; }

static int state_size(instance *of, const char *function, size_t *size) {
    if (!of || !size) return of ? tell(of, ERROR, "%s: no place for the size", function) : ERROR;
    *size = SERIALISED;
    return OK;
}

static int choose_messages(instance *of, bool on, size_t count, const char *const categories[]) {
    unsigned chosen = count ? 0 : ~0u;
    for (size_t i = 0; i < count; i++) {
        const char *name = categories[i] ? categories[i] : "";
        unsigned known = 0;
        for (int status = WARNING; status <= ERROR; status++)
            if (!strcmp(name, CATEGORIES[status])) known = 1u << status;
        if (!known) return tell(of, ERROR, "there is no category %s of messages", name);
        chosen |= known;
    }
    of->logged = on ? of->logged | chosen : of->logged & ~chosen;
    return OK;
}

#define EXPORT __attribute__((visibility("default")))
#define NONE_OF_THIS_TYPE(name)                                                                                  \
    EXPORT int name(instance *of, const reference variables[], size_t count) {                                   \
        (void)variables;                                                                                         \
        if (!of) return ERROR;                                                                                   \
        return count ? tell(of, ERROR, "%s: no variable is of this type", __func__) : OK;                        \
    }
#define NOT_PROVIDED(name)                                                                                       \
    EXPORT int name(instance *of) { return of ? tell(of, ERROR, "%s: not provided", __func__) : ERROR; }
