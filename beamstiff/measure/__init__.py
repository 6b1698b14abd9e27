"""What was seen: measurement tables, and what is computed from raw readings before they become one."""
