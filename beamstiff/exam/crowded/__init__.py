"""The exam of crowded machines: several effects of falling size at once, in a geometry that is off as well."""
