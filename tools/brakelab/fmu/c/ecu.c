/* The ECU: at a communication point each input is a sample, NaN is none; out of its range a sample is invalid. */
static int begin_unit(instance *of) {
    (void)of;
    return 0;
}

static int step_unit(instance *of, int64_t t_ns, bool communicates) {
    of->places[BEGIN_CYCLE][AT_BEGIN_CYCLE[1]] = t_ns;
    int failed = run(of, BEGIN_CYCLE);
    int64_t *sample = of->places[ACCEPT];
    for (uint32_t variable = 0; variable < COUNT && communicates; variable++) {
        double value = *number(of, variable);
        if (VARIABLES[variable].kind != INPUT || isnan(value)) continue;
        sample[AT_ACCEPT[2]] = VARIABLES[variable].place;
        memcpy(&sample[AT_ACCEPT[3]], &value, sizeof value);
        sample[AT_ACCEPT[4]] = t_ns;
        failed |= run(of, ACCEPT);
    }
    return failed | run(of, END_CYCLE) | run(of, STEP);
}
