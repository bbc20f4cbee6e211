"""Many garments on many bodies without a window: a manifest of jobs, and the work of one."""
