using System;
using System.Collections;
using System.Globalization;
using System.Reflection;
using System.Text;

namespace Foottrack.Tests
{
    /// <summary>Anything as JSON, its fields named as on the wire.</summary>
    internal static class Json
    {
        public static string Of(object value)
        {
            var text = new StringBuilder();
            Write(text, value);
            return text.ToString();
        }

        /// <summary>`PelvisDy` is `pelvis_dy`.</summary>
        public static string NameOf(string name)
        {
            var text = new StringBuilder();
            for (int i = 0; i < name.Length; i++)
            {
                if (char.IsUpper(name[i]) && i > 0)
                {
                    text.Append('_');
                }
                text.Append(char.ToLowerInvariant(name[i]));
            }
            return text.ToString();
        }

        private static void Write(StringBuilder text, object value)
        {
            if (value == null) { text.Append("null"); }
            else if (value is bool) { text.Append((bool)value ? "true" : "false"); }
            else if (value is string) { Quote(text, (string)value); }
            else if (value is double) { text.Append(((double)value).ToString("R", CultureInfo.InvariantCulture)); }
            else if (value is float) { text.Append(((float)value).ToString("R", CultureInfo.InvariantCulture)); }
            else if (value is long || value is int) { text.Append(Convert.ToInt64(value)); }
            else if (value is Enum) { Quote(text, NameOf(value.ToString())); }
            else if (value is byte[]) { Quote(text, Convert.ToBase64String((byte[])value)); }
            else if (value is IDictionary) { Pairs(text, (IDictionary)value); }
            else if (value is IEnumerable) { Items(text, (IEnumerable)value); }
            else if (value is Vec3 || value is Quat || value is Covariance) { Items(text, Fields(value)); }
            else { Pairs(text, Named(value)); }
        }

        private static void Pairs(StringBuilder text, IDictionary pairs)
        {
            string between = "{";
            foreach (DictionaryEntry pair in pairs)
            {
                text.Append(between);
                Quote(text, pair.Key is Enum ? NameOf(pair.Key.ToString()) : pair.Key.ToString());
                text.Append(": ");
                Write(text, pair.Value);
                between = ", ";
            }
            text.Append(pairs.Count == 0 ? "{}" : "}");
        }

        private static void Items(StringBuilder text, IEnumerable items)
        {
            text.Append('[');
            string between = "";
            foreach (object item in items)
            {
                text.Append(between);
                Write(text, item);
                between = ", ";
            }
            text.Append(']');
        }

        private static FieldInfo[] FieldsOf(object value)
        {
            return value.GetType().GetFields(BindingFlags.Public | BindingFlags.Instance);
        }

        private static ArrayList Fields(object value)
        {
            var found = new ArrayList();
            foreach (FieldInfo field in FieldsOf(value))
            {
                found.Add(field.GetValue(value));
            }
            return found;
        }

        private static Hashtable Named(object value)
        {
            var found = new Hashtable();
            foreach (FieldInfo field in FieldsOf(value))
            {
                // The one name that C# does not allow: a member called as its type.
                string name = value is Session && field.Name == "Id" ? "session" : NameOf(field.Name);
                found[name] = field.GetValue(value);
            }
            return found;
        }

        private static void Quote(StringBuilder text, string value)
        {
            text.Append('"');
            foreach (char c in value)
            {
                if (c == '"' || c == '\\' || c < ' ')
                {
                    text.Append("\\u").Append(((int)c).ToString("x4"));
                }
                else
                {
                    text.Append(c);
                }
            }
            text.Append('"');
        }
    }
}
