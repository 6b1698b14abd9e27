"""The exam of crowded machines: several effects at once, in a geometry that is off as well."""
