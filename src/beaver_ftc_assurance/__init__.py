"""What backs a verdict: certificates, their checker, separating manoeuvres and evidence of a whole plan."""
