"""What accuracy of fits costs: scenes fitted with many rays and steps, and chosen."""
