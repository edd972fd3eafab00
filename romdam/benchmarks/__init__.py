"""Cases with printed or closed-form answers, and romdam's beside them: `romdam benchmarks`."""
